// Where is a lost camera (covered lens, carried away, switched off and on)? Its picture's words name keyframes that
// look like it, and verification says which of them is the place (place_verifier.hpp). Where people fill the picture
// the words say little: of the keyframes at the place many come after fifty others. So kComparedPerFrame keyframes a
// frame are looked at by their descriptors, and the kTriesPerFrame most alike are verified. Those not alike are not
// looked at again until all of the map has been, a third of a second in a full one; the others are looked at in every
// frame, since what people leave to be seen changes. Runs to completion within a frame that has nothing else to do. A
// frame's features are all eligible: what stands still is not known yet.
//
// Rooms of one building look alike, and so do their keyframes: of two that are verified the better is the place, and as
// long as it is not believed each frame is held against the best keyframes there and elsewhere (weigh()).
//
// Cost: words of a frame, one query, kComparedPerFrame compared (some 0.05 ms each) and three verifications at most. A
// frame that was weighed and is searched for after all has one query, and one verification or two, more.
#pragma once

#include <cstdint>
#include <span>

#include "engine/matching/map_matcher.hpp"
#include "engine/outputs.hpp"
#include "engine/parameters.hpp"
#include "engine/recognition/place_search.hpp"

namespace stillmesh {

class Relocalisation {
public:
    static constexpr std::uint32_t kTriesPerFrame = 2;
    static constexpr std::uint32_t kComparedPerFrame = 32;
    static constexpr std::uint32_t kComparedNear = 8;  // of them, with keyframes where the camera is taken to be
    static constexpr std::uint32_t kAlikeMin = 6;      // features; by accident it is one or two
    static constexpr double kSame_m = 0.3;             // poses that say the same
    static constexpr double kSame_rad = 0.2;

    static constexpr void plan(ArenaPlan& arena, const Limits& limits) noexcept {
        arena.array<std::uint8_t>(limits.keyframes_max);
        arena.array<std::uint16_t>(limits.keyframes_max);
        FrameWords::plan(arena, limits.features_max);
    }
    void create(Arena& arena, const Limits& limits, const Parameters& configuration, PlaceSearch& places) noexcept;
    void reset() noexcept;

    [[nodiscard]] bool is_on() const noexcept { return places_->is_on() && configuration_->loop.is_relocalising; }
    // Another frame comes.
    void begin_frame() noexcept { is_in_frame_ = is_weighed_ = false; }
    // Matches the frame with a keyframe through the direct index (method.md 2): as many matches as all pairs give, in a
    // ninth of the time (docs/places.md). A keyframe whose words are not known yet gets them for this: all pairs were
    // 60 million instructions, two thirds of a whole frame. False: nothing was done, relocalisation is off.
    [[nodiscard]] bool match(const Map& map, Handle<Keyframe> keyframe, std::span<const Descriptor> descriptors,
                             MapMatcher& matcher) noexcept;

    // Begins to ask about the frame, whose descriptors are borrowed until the next; then its features one by one.
    void begin(std::span<const Descriptor> descriptors, const NoiseFactors& noise) noexcept;
    void add_feature(const Observation& observation) noexcept;
    // True: world_from_camera() and matches() are the answer.
    [[nodiscard]] bool find(const Map& map) noexcept;
    // How much the frame looks like the best keyframes (PlaceVerifier::likeness): where the camera is taken to be, and
    // anywhere else.
    struct Evidence {
        std::uint64_t here = 0, elsewhere = 0;
    };
    [[nodiscard]] Evidence weigh(const Map& map, const SE3& world_from_camera) noexcept;
    [[nodiscard]] const SE3& world_from_camera() const noexcept { return places_->verifier().world_from_query(); }
    [[nodiscard]] std::span<const PlaceMatch> matches() const noexcept { return places_->verifier().agreeing(); }

    void note_success() noexcept {
        ++successes_;
        forget(kDismissed | kTried);
    }
    void fill(LoopStatistics& statistics) const noexcept;

private:
    struct Place {
        Handle<Keyframe> keyframe;
        std::uint32_t worth = 0;  // features alike
    };
    // The words of the features added, and the keyframes that have some. False: there are too few features.
    [[nodiscard]] bool query(const Map& map) noexcept;
    void find_words(std::span<const Descriptor> descriptors) noexcept;
    [[nodiscard]] std::uint32_t count_alike(const Map& map, Handle<Keyframe> keyframe) noexcept;
    [[nodiscard]] bool verify(const Map& map, Handle<Keyframe> keyframe) noexcept;

    static constexpr std::uint8_t kDismissed = 1, kTried = 2;
    static constexpr std::uint16_t kUnknown = 0xffff;
    void forget(std::uint8_t marks) noexcept {
        for (std::uint8_t& mark : marks_) mark = static_cast<std::uint8_t>(mark & ~marks);
    }

    const Parameters* configuration_ = nullptr;  // outlives it
    PlaceSearch* places_ = nullptr;
    std::span<const Descriptor> descriptors_;
    NoiseFactors noise_;
    Handle<Keyframe> rival_;         // the best of the last weigh() that speaks for another place: the next to be tried
    std::span<std::uint8_t> marks_;  // by keyframe slot, in this round
    std::span<std::uint16_t> alike_;  // by keyframe slot: features alike in this frame; kUnknown: not counted yet
    FrameWords there_;                // of a keyframe whose words are not known yet
    std::uint32_t compared_ = 0;      // keyframes in this frame
    bool is_in_frame_ = false;        // its words are found
    bool is_weighed_ = false;         // and it was held against the best keyframes
    std::uint64_t matched_ = 0, queries_ = 0, candidates_ = 0, successes_ = 0;
};

}  // namespace stillmesh
