// Where is a lost camera (covered lens, carried away, switched off and on)? Its picture's words name keyframes that
// look like it, and verification says which of them is the place (place_verifier.hpp). Runs to completion within a
// frame that has nothing else to do, at most kTriesPerFrame places a frame, the next best ones in the next frame. A
// frame's features are all eligible: who stands still is not known yet. Cost: words of a frame, one query,
// kTriesPerFrame verifications.
#pragma once

#include <cstdint>
#include <span>

#include "engine/configuration.hpp"
#include "engine/engine.hpp"
#include "engine/tasks/place_search.hpp"

namespace stillmesh {

class Relocalisation {
public:
    static constexpr std::uint32_t kTriesPerFrame = 2;
    static constexpr std::uint32_t kTurns = 8;

    void create(const Configuration& configuration, PlaceSearch& places) noexcept;
    void reset() noexcept;

    [[nodiscard]] bool is_on() const noexcept { return places_->is_on() && configuration_->loop.is_relocalising; }
    // Begins with a new frame; then its features one by one.
    void begin(std::span<const Descriptor> descriptors) noexcept;
    void add_feature(const Observation& observation) noexcept;
    // True: world_from_camera() and matches() are the answer.
    [[nodiscard]] bool find(const Map& map, std::span<const Descriptor> descriptors,
                            const PlaceVerifier::Noise& noise) noexcept;
    [[nodiscard]] const SE3& world_from_camera() const noexcept { return places_->verifier().world_from_query(); }
    [[nodiscard]] std::span<const PlaceMatch> matches() const noexcept { return places_->verifier().agreeing(); }

    void note_success() noexcept { ++successes_; }
    void fill(EngineStatistics& statistics) const noexcept;

private:
    const Configuration* configuration_ = nullptr;  // outlives it
    PlaceSearch* places_ = nullptr;
    std::uint32_t turn_ = 0;
    std::uint64_t queries_ = 0, candidates_ = 0, successes_ = 0;
};

}  // namespace stillmesh
