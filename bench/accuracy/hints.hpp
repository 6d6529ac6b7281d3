// Hints of the motion made from the truth, with the errors and the faults of instruments (--hints).
#pragma once

#include <cstdint>
#include <string>

#include "platform/motion/simulated_motion.hpp"

namespace stillmesh::accuracy {

enum class HintSource : std::uint8_t { kNone, kWheels, kGyroscope, kBoth };

// One kind of hint, by its name: what it comes from, and what is wrong with it.
struct HintKind {
    const char* name = "";
    HintSource source = HintSource::kNone;
    double excess = 1;                        // errors over what is claimed
    bool slips_first = false, slips = false;  // in the first second; later, twice
    const char* sentence = "";
};
// nullptr: no such kind.
[[nodiscard]] const HintKind* hint_kind(const std::string& name);
// All names with their sentences, a line each.
[[nodiscard]] std::string hint_kinds_text();

// Of one run.
class HintMaker {
public:
    HintMaker(const HintKind* kind, std::uint64_t seed);
    // Of a frame with this true pose, so many seconds from the first one. nullptr: none.
    [[nodiscard]] const MotionHint* hint(const TrajectoryPose& truth, double second);

private:
    const HintKind* kind_;
    SimulatedMotion motion_;
    MotionHint hint_;
};

}  // namespace stillmesh::accuracy
