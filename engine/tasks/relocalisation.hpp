// Where is a lost camera (covered lens, carried away, switched off and on)? Its picture's words name keyframes that
// look like it, and verification says which of them is the place (place_verifier.hpp). Where people fill the picture
// the words say little: of the keyframes at the place many come after fifty others. So kLooksPerFrame keyframes a frame
// are looked at by their descriptors, and the kTriesPerFrame most alike are verified. Who is not alike is not looked at
// again until all of the map has been, a third of a second in a full one; who is, is looked at in every frame, since
// what people leave to be seen changes. Runs to completion within a frame that has nothing else to do. A frame's
// features are all eligible: who stands still is not known yet. Cost: words of a frame, one query, kLooksPerFrame looks
// (some 0.05 ms each) and kTriesPerFrame verifications.
#pragma once

#include <cstdint>
#include <span>

#include "engine/configuration.hpp"
#include "engine/engine.hpp"
#include "engine/matching/map_matcher.hpp"
#include "engine/tasks/place_search.hpp"

namespace stillmesh {

class Relocalisation {
public:
    static constexpr std::uint32_t kTriesPerFrame = 2;
    static constexpr std::uint32_t kLooksPerFrame = 32;
    static constexpr std::uint32_t kAlikeMin = 6;     // features; by accident it is one or two
    static constexpr std::uint32_t kSlotsMax = 1024;  // limits.keyframes_max is never more

    void create(const Configuration& configuration, PlaceSearch& places) noexcept;
    void reset() noexcept;

    [[nodiscard]] bool is_on() const noexcept { return places_->is_on() && configuration_->loop.is_relocalising; }
    // Matches the frame with a keyframe through the direct index (method.md 2): as many matches as all pairs give, in a
    // ninth of the time (docs/places.md). False: nothing was done, since the keyframe's words are not known (yet).
    [[nodiscard]] bool match(const Map& map, Handle<Keyframe> keyframe, std::span<const Descriptor> descriptors,
                             MapMatcher& matcher) noexcept;

    // Begins with a new frame; then its features one by one.
    void begin(std::span<const Descriptor> descriptors) noexcept;
    void add_feature(const Observation& observation) noexcept;
    // True: world_from_camera() and matches() are the answer.
    [[nodiscard]] bool find(const Map& map, std::span<const Descriptor> descriptors,
                            const PlaceVerifier::Noise& noise) noexcept;
    [[nodiscard]] const SE3& world_from_camera() const noexcept { return places_->verifier().world_from_query(); }
    [[nodiscard]] std::span<const PlaceMatch> matches() const noexcept { return places_->verifier().agreeing(); }

    void note_success() noexcept {
        ++successes_;
        forget(kDismissed | kTried);
    }
    void fill(EngineStatistics& statistics) const noexcept;

private:
    static constexpr std::uint8_t kDismissed = 1, kTried = 2;
    void forget(std::uint8_t marks) noexcept {
        for (std::uint8_t& mark : marks_) mark = static_cast<std::uint8_t>(mark & ~marks);
    }

    const Configuration* configuration_ = nullptr;  // outlives it
    PlaceSearch* places_ = nullptr;
    std::uint8_t marks_[kSlotsMax] = {};  // by slot, in this round
    std::uint64_t matched_ = 0, queries_ = 0, candidates_ = 0, successes_ = 0;
};

}  // namespace stillmesh
