// What a D435 answers to Intel's commands, which go through control 1 of its extension unit: a message of 1024 bytes in
// (length of what follows the first four bytes, 0xcdab, operation, four parameters), one of 1024 bytes out (the
// operation again or a negative error, data, in the last four bytes how many). Known: GVD (firmware, serial number),
// GETINTCAL (tables 25: depth, 32: colour, of the rendered cameras), GET_ADV (9: unit of depth), and 0x77 (the emitter
// by turns: 1, or as its control says: 0). Layouts as librealsense reads them (ds5-private.h, hw-monitor.h).
#pragma once

#include "tests/vm/usbip.hpp"

namespace vm {

inline constexpr std::size_t kMessageBytes = 1024;
inline constexpr std::uint32_t kDepthUnit_um = 1000;
inline constexpr double kColourAside_mm = 15;  // the colour camera stands so far to the left of the depth camera

// Of both rendered cameras: focal length in px at a width of 640 px, and with the width; the axis through the middle.
inline constexpr double kFocalOf640_px = 528;

struct MonitorSettings {
    bool is_corrupt = false;   // tables do not have their checksum
    bool is_together = false;  // both cameras stand in one place, and the table says so
    bool has_turns = false;    // the emitter is on for every other picture alone
};

[[nodiscard]] Bytes answer_message(const Bytes& message, MonitorSettings& settings);

}  // namespace vm
