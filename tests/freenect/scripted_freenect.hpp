// A libfreenect of the test's own: as much of it as FreenectCamera uses, over one Kinect that a test scripts.
#pragma once

#include <atomic>
#include <cstdint>

namespace stillmesh::test {

struct ScriptedKinect {
    std::atomic<int> devices{1};
    std::atomic<bool> is_registered{true};  // offers registered millimetres
    std::atomic<bool> refuses_open{false};
    std::atomic<bool> hangs{false};          // opening, or processing events, does not come back while this is set
    std::atomic<int> hanging{0};             // calls that do so now
    std::atomic<bool> is_silent{false};      // no images
    std::atomic<int> silences{0};            // calls that brought none
    std::atomic<std::uint32_t> stamp{1000};  // of the next pair, 60 MHz
    std::atomic<std::uint32_t> pairs{0};     // delivered
    std::atomic<int> contexts{0};            // not yet shut down
    std::atomic<int> open_devices{0};
    std::atomic<std::uint32_t> subdevices{0};
};
// One for all, as libfreenect's devices are.
extern ScriptedKinect scripted_kinect;

}  // namespace stillmesh::test
