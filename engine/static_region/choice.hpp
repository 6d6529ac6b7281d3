// Which hypothesis names the static region, and how sure that is (method.md 5).
#pragma once

#include <cstddef>
#include <cstdint>

#include "engine/static_region/hypotheses.hpp"
#include "engine/static_region/region_input.hpp"

namespace stillmesh {

// The motion that contradicts the chosen one most, and how much of the surface in view each of both explains.
struct Rival {
    std::size_t hypothesis = Hypotheses::kNone;  // kNone: no other motion explains more than noise
    double margin = 1;        // of what only one of both explains, the chosen one's less the rival's; [-1, 1]
    double share = 0;         // whatever weight it has
    double chosen_share = 0;  // likewise; also without a rival
};

// The motion that contradicts the chosen one most by surface alone, whatever was expected: the one to carry on.
struct Contest {
    std::size_t hypothesis = Hypotheses::kNone;
    SE3 world_from_camera;
    double margin = 1;           // as a rival's; what goes on as the rival of the frames before is to be expected, too
    bool is_carried_on = false;  // it does
    bool is_tenable = false;     // either may be the room's: a small margin, and not for the first time
};

struct RegionChoice {
    std::size_t hypothesis = Hypotheses::kNone;  // that is chosen
    Rival rival;                                 // or the contest's motion, where that one is the stronger
    Contest contest;
    SE3 world_from_camera;         // of the chosen hypothesis
    double score = 0;              // of the choice, [0, 1]
    double plausibility = 1;       // of its motion; a factor of the score
    double margin = 0;             // over the strongest rival, of what only one of both explains; [-1, 1]
    double explained_share = 0;    // of the weighted, by any hypothesis
    std::uint32_t iterations = 0;  // of RANSAC
    bool is_valid = false;
};

// The highest score, ties by the first; there is at least one hypothesis.
[[nodiscard]] std::size_t best_of(const Hypotheses& hypotheses) noexcept;

// Before points have a past: the body with the largest surface, if it is another one than the best's; else the best.
// Nothing but its size tells the room from a body then, and hypotheses of one body differ by noise.
[[nodiscard]] std::size_t largest_of(const RegionInput& input, const Hypotheses& hypotheses, std::size_t best) noexcept;

// Where two bodies have points with a past, and the best one's contradicts another of which region.elder_points points
// were there before all but two of its own: that one, however small. (A lift's doors stand still for three seconds
// while they are shut; the cabin stood before.) Else the best.
[[nodiscard]] std::size_t elder_of(const RegionInput& input, const Hypotheses& hypotheses, std::size_t best) noexcept;

// Against every other motion: of the surface that only one of both explains, what the best one does minus what the
// other one does, as far as that is plausible; the rival is the one with the least of it, ties by the first.
[[nodiscard]] Rival rival_of(const RegionInput& input, const Hypotheses& hypotheses, std::size_t best) noexcept;

// Likewise of the motion that contradicts the best one most, plausible or not.
[[nodiscard]] Contest contest_of(const RegionInput& input, const Hypotheses& hypotheses, std::size_t best) noexcept;

// `chosen`: the correspondences that agree with the choice, whose groups agree. Not valid, and nothing chosen: fewer
// than three of them. The agreement of each group is with the choice afterwards.
[[nodiscard]] RegionChoice choose_best(const RegionInput& input, Hypotheses& hypotheses,
                                       FixedVector<std::uint16_t>& chosen) noexcept;

}  // namespace stillmesh
