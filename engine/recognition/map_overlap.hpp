// Where two maps show the same place, and how one lies in the other. Both are in one pool: keyframes of the map first,
// then those of the other one, in coordinates of their own. Each keyframe of the other is a camera that is lost in the
// map (relocalisation.hpp), seen with the features of its points that stand still; what it finds is a vote for one
// motion of the whole other map. Votes for about the same motion are one, the motion with most keyframes is tried:
// every keyframe of the other is then held against the map there and anywhere else, as a camera on probation is. The
// maps overlap if enough keyframes agree, and hardly anything elsewhere looks alike.
// Limits: kMotionsMax motions are told apart; of more the weakest is forgotten. No memory of its own. Cost: each
// keyframe of the other searched for once and weighed once, some 3 ms each; for tools, not between frames.
#pragma once

#include <cstdint>

#include "engine/recognition/place_search.hpp"
#include "engine/recognition/relocalisation.hpp"

namespace stillmesh {

struct Overlap {
    bool is_found = false;
    SE3 map_from_other;
    Handle<Keyframe> keyframe, place;           // of the other map, and of this: seen best
    std::uint32_t found = 0;                    // keyframes of the other that were recognised somewhere
    std::uint32_t agreeing = 0;                 // of them, where the motion tried puts them
    std::uint64_t likeness = 0, elsewhere = 0;  // Relocalisation::Evidence of all keyframes together
};

class MapOverlap {
public:
    static constexpr std::uint32_t kMotionsMax = 16;
    static constexpr std::uint32_t kAgreeingMin = 4;  // keyframes
    // Of the likeness. Rooms and laps have up to .003. A corridor whose sections look alike has .1 to 2 whether both
    // maps have a section in common or not, and at .2 one was joined a section off: where places look alike nothing is
    // sure.
    static constexpr double kElsewhereMax = 0.05;

    // Keyframes in slots below `slots_of_map` are the map's. The searches are left empty.
    MapOverlap(const Map& map, const Parameters& parameters, PlaceSearch& places, Relocalisation& relocalisation,
               std::uint32_t slots_of_map) noexcept
        : map_(map),
          parameters_(parameters),
          places_(places),
          relocalisation_(relocalisation),
          slots_of_map_(slots_of_map) {}

    [[nodiscard]] Overlap find() noexcept;
    // True: a keyframe of the other map is recognised; Relocalisation says where, and by which points.
    [[nodiscard]] bool recognise(std::uint32_t slot) noexcept;
    // As to be the same motion of the other map: by where they put one of its cameras.
    [[nodiscard]] static bool is_same(const SE3& a, const SE3& b) noexcept;

private:
    struct Motion {
        SE3 map_from_other;
        Handle<Keyframe> keyframe, place;
        std::uint32_t keyframes = 0;  // that vote for it
        std::uint64_t likeness = 0;   // of the best
    };
    void learn_places() noexcept;
    void begin(std::uint32_t slot) noexcept;
    void vote(std::uint32_t slot) noexcept;
    void weigh(Overlap& overlap) noexcept;

    const Map& map_;
    const Parameters& parameters_;
    PlaceSearch& places_;
    Relocalisation& relocalisation_;
    std::uint32_t slots_of_map_;
    Motion motions_[kMotionsMax];
    std::uint32_t motions_count_ = 0;
};

}  // namespace stillmesh
