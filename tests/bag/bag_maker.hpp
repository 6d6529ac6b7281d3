// Frames of a simulated room as a folder in the TUM layout and, by make_bag.py, as bags: the same pixels, times and
// camera in both.
#pragma once

#include <gtest/gtest.h>

#include <cstdio>
#include <cstdlib>
#include <string>
#include <vector>

#include "hal/bag/bag_camera.hpp"
#include "hal/calibration/calibration.hpp"
#include "hal/simulated/simulated_camera.hpp"
#include "tests/replay/recording_folder.hpp"
#include "tests/support/frames.hpp"

namespace stillmesh::test {

struct RoomOptions {
    std::uint32_t frames = 8;
    std::uint32_t width = 320;
    std::uint32_t height = 240;
    std::uint32_t units_per_m = 1000;  // 1000 or 5000
    bool is_rgb = false;
    std::int64_t depth_lag_ns = 2'000'000;
    bool is_depth_separate = false;  // of a camera beside colour's, 192x120, which camera.toml names
};

class Room {
public:
    explicit Room(const RoomOptions& options = {}) : options_(options) {
        render();
        std::string rgb, depth, frames;
        for (std::uint32_t i = 0; i < sequence_.frames.size(); ++i) {
            KeptFrame& frame = sequence_.frames[i];
            frame.time_ns += 1'700'000'000'000'000'000;
            frame.depth_units_per_m = options.units_per_m;
            if (options.units_per_m == 1000) {
                for (std::uint16_t& value : frame.depth) value = static_cast<std::uint16_t>((value + 2) / 5);
            }
            write_frame(i, frame);
            const std::string number = std::to_string(i);
            rgb += seconds(frame.time_ns) + " rgb/" + number + ".png\n";
            depth += seconds(frame.time_ns + options.depth_lag_ns) + " depth/" + number + ".png\n";
            frames += std::string(i > 0 ? "," : "") + "{\"colour_ns\":" + std::to_string(frame.time_ns) +
                      ",\"depth_ns\":" + std::to_string(frame.time_ns + options.depth_lag_ns) + ",\"colour\":\"rgb/" +
                      number + ".grey\",\"depth\":\"depth/" + number + ".u16\",\"colour_file\":\"rgb/" + number +
                      ".png\"}";
        }
        write_text(folder() + "/rgb.txt", rgb);
        write_text(folder() + "/depth.txt", depth);
        write_text(folder() + "/camera.toml", calibration_toml(info_));
        std::string json = "{\"width\":" + std::to_string(options.width) +
                           ",\"height\":" + std::to_string(options.height) + numbers(info_.model);
        if (info_.separate_depth) {
            const SeparateDepth& depth_camera = *info_.separate_depth;
            json += ",\"depth_camera\":{\"width\":" + std::to_string(depth_camera.model.width) +
                    ",\"height\":" + std::to_string(depth_camera.model.height) + numbers(depth_camera.model) +
                    ",\"t\":" + list(depth_camera.colour_from_depth.translation_m, 3) +
                    ",\"q\":" + list(depth_camera.colour_from_depth.rotation_xyzw, 4) + "}";
        }
        write_text(folder() + "/frames.json", json + ",\"frames\":[" + frames + "]}");
    }

    [[nodiscard]] std::string folder() const { return scratch_.path("room"); }
    [[nodiscard]] std::string path(const std::string& name) const { return scratch_.path(name); }
    [[nodiscard]] const std::vector<KeptFrame>& frames() const { return sequence_.frames; }
    [[nodiscard]] const CameraModel& camera() const { return sequence_.camera; }

    // The bag's path. `arguments` are make_bag.py's.
    [[nodiscard]] std::string bag(const std::string& name, const std::string& arguments) const {
        const std::string command = std::string(STILLMESH_BAG_PYTHON) + " -B " + STILLMESH_MAKE_BAG + " " + folder() +
                                    " " + path(name) + " " + arguments;
        EXPECT_EQ(std::system(command.c_str()), 0) << command;
        return path(name);
    }

private:
    void render() {
        SimulationOptions options;
        options.scene = "walking_xyz";
        options.frames = options_.frames;
        options.width = options_.width;
        options.height = options_.height;
        if (options_.is_depth_separate) {
            SeparateDepth depth;
            depth.model.width = 192, depth.model.height = 120;
            depth.model.fx = depth.model.fy = 96, depth.model.cx = 95.5, depth.model.cy = 59.5;
            depth.colour_from_depth = {{0.0, 0.0043632932, 0.0, 0.9999904807}, {0.015, 0.001, -0.002}};
            options.separate_depth = depth;
        }
        SimulatedCamera camera(options);
        ASSERT_EQ(camera.open(), Status::kOk) << camera.message();
        info_ = camera.info();
        info_.separate_depth = options.separate_depth;
        info_.depth_units_per_m = options_.units_per_m;
        sequence_.camera = info_.model;
        for (Frame frame; camera.poll(frame) == Status::kOk;) {
            KeptFrame kept;
            kept.width = options.width;
            kept.height = options.height;
            kept.time_ns = frame.time_ns;
            const std::size_t pixels = std::size_t{frame.colour.width} * frame.colour.height;
            kept.colour.assign(frame.colour.data, frame.colour.data + pixels);
            depth_width_ = frame.depth.width;
            depth_height_ = frame.depth.height;
            kept.depth.assign(frame.depth.data, frame.depth.data + std::size_t{depth_width_} * depth_height_);
            sequence_.frames.push_back(std::move(kept));
        }
    }

    [[nodiscard]] static std::string list(const double* values, std::size_t count) {
        std::string out;
        for (std::size_t i = 0; i < count; ++i) {
            char text[40];
            std::snprintf(text, sizeof(text), "%s%.17g", i > 0 ? "," : "", values[i]);
            out += text;
        }
        return "[" + out + "]";
    }
    [[nodiscard]] static std::string numbers(const CameraModel& camera) {
        char text[200];
        std::snprintf(text, sizeof(text), ",\"fx\":%.17g,\"fy\":%.17g,\"cx\":%.17g,\"cy\":%.17g", camera.fx, camera.fy,
                      camera.cx, camera.cy);
        return text;
    }
    [[nodiscard]] static std::string seconds(std::int64_t time_ns) {
        char text[40];
        std::snprintf(text, sizeof(text), "%lld.%09lld", static_cast<long long>(time_ns / 1'000'000'000),
                      static_cast<long long>(time_ns % 1'000'000'000));
        return text;
    }

    // Of RGB red is 3 more and blue 5 less than grey, as in make_bag.py.
    void write_frame(std::uint32_t index, KeptFrame& frame) {
        const std::string number = std::to_string(index);
        write_bytes(folder() + "/rgb/" + number + ".grey", frame.colour);
        if (options_.is_rgb) {
            std::vector<std::uint8_t> rgb;
            for (const std::uint8_t grey : frame.colour) {
                rgb.push_back(static_cast<std::uint8_t>(grey + 3));
                rgb.push_back(grey);
                rgb.push_back(static_cast<std::uint8_t>(grey - 5));
            }
            frame.colour = rgb;
            frame.format = PixelFormat::kRgb8;
        }
        write_bytes(
            folder() + "/rgb/" + number + ".png",
            encode_png(frame.width, frame.height,
                       options_.is_rgb ? SPNG_COLOR_TYPE_TRUECOLOR : SPNG_COLOR_TYPE_GRAYSCALE, 8, frame.colour));
        std::vector<std::uint8_t> depth(2 * frame.depth.size());
        std::copy_n(reinterpret_cast<const std::uint8_t*>(frame.depth.data()), depth.size(), depth.begin());
        write_bytes(folder() + "/depth/" + number + ".u16", depth);
        write_bytes(folder() + "/depth/" + number + ".png",
                    encode_png(depth_width_, depth_height_, SPNG_COLOR_TYPE_GRAYSCALE, 16, depth));
    }

    RoomOptions options_;
    TemporaryFolder scratch_;
    Sequence sequence_;
    CameraInfo info_;
    std::uint32_t depth_width_ = 0, depth_height_ = 0;  // px
};

}  // namespace stillmesh::test
