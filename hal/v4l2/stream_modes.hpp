// What a video node offers, and which modes of depth and colour go together best: near 30 images/s, depth near 848x480
// (what stereo cameras are best at), colour near 640x480 within the limits. What a driver lists is taken as untrusted:
// lists are cut at kModesMax, sizes and rates that make no sense are left out.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "hal/v4l2/v4l2_link.hpp"

namespace stillmesh::v4l2 {

inline constexpr std::size_t kModesMax = 512;  // of a node

struct Mode {
    std::uint32_t fourcc = 0;
    V4l2Size size;
    V4l2Interval interval;

    [[nodiscard]] double frames_per_s() const noexcept {
        return static_cast<double>(interval.denominator) / interval.numerator;
    }
};
// "YUYV 640x480@30"
[[nodiscard]] std::string mode_text(const Mode& mode);
// The sizes and rates of one kind that are named, for a message: "640x480@30 320x240@30"; "none".
[[nodiscard]] std::string modes_text(const std::vector<Mode>& modes, bool is_of_depth);

// 0, or the errno of a node that has gone. Formats that are not understood are left out.
[[nodiscard]] int list_modes(V4l2Link& link, int handle, std::vector<Mode>& modes);

struct ModePair {
    Mode depth, colour;

    // What both move over the bus, at most (compressed colour: as if it were not).
    [[nodiscard]] double bytes_per_s() const noexcept;
};

struct ModeWishes {
    std::uint32_t width_max = 640, height_max = 480;  // px, of colour
    bool has_y16_depth = true;                        // 16-bit grey is depth; RealSense sends raw infrared in it
    bool has_jpeg = true;                             // this build decodes it
    bool has_infrared_colour = true;                  // grey images will do
    bool is_one_view = false;                         // grey of depth's size: the same camera's, pixel by pixel
    double rate_best = 30;                            // images/s
    V4l2Size depth_first, colour_first;               // sizes of before; 0: none
};
// Best first, at most 4096. Empty: no two modes can be used.
[[nodiscard]] std::vector<ModePair> rank_modes(const std::vector<Mode>& depth, const std::vector<Mode>& colour,
                                               const ModeWishes& wishes);

}  // namespace stillmesh::v4l2
