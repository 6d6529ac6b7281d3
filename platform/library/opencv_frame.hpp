// A Frame of two cv::Mat: colour CV_8UC1 (grey), CV_8UC3 (BGR) or CV_8UC4 (BGRA), depth CV_16UC1 or CV_32FC1 (metres).
// What fits as it is is borrowed, strides included, and has to live until submit() returns; BGRA and float depth are
// converted into memory of the CvFrame. Header only; the program brings OpenCV's core.
//
//   CvFrame frames;
//   Frame frame;
//   if (frames.from(colour, depth, time_ns, frame) == Status::kOk) engine.submit(frame);
#pragma once

#include <cstdint>
#include <opencv2/core/mat.hpp>
#include <vector>

#include "engine/base/status.hpp"
#include "platform/library/frame_conversion.hpp"

namespace stillmesh {

class CvFrame {
public:
    static constexpr double kFloatUnits_per_m = 5000;  // that float depth is given to the engine in

    // `depth_units_per_m`: of CV_16UC1, 1000 for millimetres; float depth has its own.
    //   kInvalid  one of them is empty, of another type, or their sizes differ: `frame` is as it was
    [[nodiscard]] Status from(const cv::Mat& colour, const cv::Mat& depth, std::int64_t time_ns, Frame& frame,
                              double depth_units_per_m = 1000) {
        if (colour.empty() || depth.empty() || colour.size() != depth.size()) return Status::kInvalid;
        if (depth.type() != CV_16UC1 && depth.type() != CV_32FC1) return Status::kInvalid;
        Frame out;
        out.time_ns = time_ns;
        const PixelBytes colour_bytes = bytes_of(colour);
        switch (colour.type()) {
            case CV_8UC1:
            case CV_8UC3:
                out.format = colour.channels() == 1 ? PixelFormat::kGrey8 : PixelFormat::kBgr8;
                out.colour = {colour.ptr(), colour_bytes.width, colour_bytes.height, colour_bytes.stride_bytes};
                break;
            case CV_8UC4:
                colour_.resize(3 * colour_bytes.pixels());
                out.format = PixelFormat::kBgr8;
                out.colour = colour_from_four(colour_bytes, colour_);
                break;
            default: return Status::kInvalid;
        }
        const PixelBytes depth_bytes = bytes_of(depth);
        if (depth.type() == CV_16UC1) {
            out.depth = depth_view(depth_bytes);
            out.depth_units_per_m = depth_units_per_m;
        } else {
            depth_.resize(depth_bytes.pixels());
            out.depth = depth_from_float(depth_bytes, kFloatUnits_per_m, depth_);
            out.depth_units_per_m = kFloatUnits_per_m;
        }
        frame = out;
        return Status::kOk;
    }

private:
    [[nodiscard]] static PixelBytes bytes_of(const cv::Mat& mat) {
        return {mat.ptr(), static_cast<std::uint32_t>(mat.cols), static_cast<std::uint32_t>(mat.rows), mat.step[0]};
    }

    std::vector<std::uint8_t> colour_;  // BGR of BGRA
    std::vector<std::uint16_t> depth_;  // of float metres
};

}  // namespace stillmesh
