#include "hal/ros2/ros2_images.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstring>

#include "hal/calibration/calibration.hpp"
#include "hal/ros2/packed_images.hpp"

namespace stillmesh {
namespace {

constexpr std::size_t kCoefficientsMax = 14;

[[nodiscard]] std::string encoding_problem(const RosImageView& image, const char* known) {
    return "has the encoding '" + std::string(image.encoding.substr(0, 32)) + "'; known are " + known + ".";
}

// Whether so many bytes a pixel are there.
[[nodiscard]] bool is_whole(const RosImageView& image, std::size_t pixel_bytes, std::string& problem) {
    const std::size_t row_bytes = image.width * pixel_bytes;
    const bool is_sized =
        image.width > 0 && image.height > 0 && image.width <= kRosImageSideMax && image.height <= kRosImageSideMax;
    if (is_sized && image.step >= row_bytes &&
        image.bytes.size() >= std::size_t{image.step} * (image.height - 1) + row_bytes) {
        return true;
    }
    problem = "is " + std::to_string(image.width) + "x" + std::to_string(image.height) + " with " +
              std::to_string(image.step) + " bytes a row, and has " + std::to_string(image.bytes.size()) +
              " bytes: that does not go together, or is larger than 4096 px.";
    return false;
}

[[nodiscard]] const std::uint8_t* row_of(const RosImageView& image, std::uint32_t y) {
    return image.bytes.data() + std::size_t{y} * image.step;
}

}  // namespace

bool colour_of(const RosImageView& image, std::vector<std::uint8_t>& pixels, PixelFormat& format,
               std::string& problem) {
    if (image.encoding == "rgb8") {
        format = PixelFormat::kRgb8;
    } else if (image.encoding == "bgr8") {
        format = PixelFormat::kBgr8;
    } else if (image.encoding == "mono8") {
        format = PixelFormat::kGrey8;
    } else {
        problem = encoding_problem(image, "rgb8, bgr8 and mono8");
        return false;
    }
    const std::uint32_t channels = channels_of(format);
    if (!is_whole(image, channels, problem)) return false;
    const std::size_t row_bytes = std::size_t{image.width} * channels;
    pixels.resize(row_bytes * image.height);
    for (std::uint32_t y = 0; y < image.height; ++y) {
        std::memcpy(pixels.data() + y * row_bytes, row_of(image, y), row_bytes);
    }
    return true;
}

bool depth_of(const RosImageView& image, std::vector<std::uint16_t>& pixels, double& units_per_m,
              std::string& problem) {
    const bool is_float = image.encoding == "32FC1";
    if (!is_float && image.encoding != "16UC1" && image.encoding != "mono16") {
        problem = encoding_problem(image, "16UC1 and 32FC1");
        return false;
    }
    if (image.is_bigendian) {
        problem = "is big-endian, which is not known here.";
        return false;
    }
    if (!is_whole(image, is_float ? sizeof(float) : sizeof(std::uint16_t), problem)) return false;
    units_per_m = is_float ? kQuarters : kMillimetres;
    pixels.resize(std::size_t{image.width} * image.height);
    for (std::uint32_t y = 0; y < image.height; ++y) {
        std::uint16_t* const out = pixels.data() + std::size_t{y} * image.width;
        const std::uint8_t* const row = row_of(image, y);
        if (!is_float) {
            std::memcpy(out, row, image.width * sizeof(std::uint16_t));
            continue;
        }
        for (std::uint32_t x = 0; x < image.width; ++x) {
            float metres = 0;
            std::memcpy(&metres, row + x * sizeof(float), sizeof(float));
            // NaN, infinity and what is behind the camera fail the comparison.
            const float units = metres * static_cast<float>(kQuarters) + 0.5F;
            out[x] = units >= 1.0F && units < 65536.0F ? static_cast<std::uint16_t>(units) : std::uint16_t{0};
        }
    }
    return true;
}

Status lens_of(const RosLensView& lens, CameraInfo& info, std::string& problem) {
    if (lens.is_cut) {
        problem = "is of binned or cut images, which is not known here.";
        return Status::kInvalid;
    }
    if (lens.k[0] == 0) {
        problem = "has no focal length: the driver is not calibrated.";
        return Status::kInvalid;
    }
    if (lens.k[6] != 0 || lens.k[7] != 0) {  // a file may have it column by column; a message has it row by row
        problem = "has a camera matrix K whose last row is not 0 0 1.";
        return Status::kInvalid;
    }
    std::string text = "image_width: " + std::to_string(lens.width) + "\nimage_height: " + std::to_string(lens.height);
    const auto append = [&text](const char* key, std::span<const double> numbers) {
        text += std::string("\n") + key + ": [";
        for (std::size_t i = 0; i < numbers.size(); ++i) {
            std::array<char, 40> number{};
            static_cast<void>(std::snprintf(number.data(), number.size(), "%s%.17g", i > 0 ? ", " : "", numbers[i]));
            text += number.data();
        }
        text += "]";
    };
    append("camera_matrix", lens.k);
    std::array<double, 5> none{};  // some drivers of rectified images send no coefficients
    if (lens.d.empty()) {
        text += "\ndistortion_model: plumb_bob";
        append("distortion_coefficients", none);
    } else {
        // A name of ROS has letters, digits and _; anything else would be another text.
        const bool is_name = std::all_of(lens.model.begin(), lens.model.end(), [](char c) {
            return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_';
        });
        if (!is_name || lens.model.empty() || lens.model.size() > 40 || lens.d.size() > kCoefficientsMax) {
            problem = "has no distortion model that has a name.";
            return Status::kInvalid;
        }
        text += "\ndistortion_model: " + std::string(lens.model);
        append("distortion_coefficients", lens.d);
    }
    return parse_calibration(text + "\n", CalibrationFormat::kYaml, "camera_info", info, problem);
}

}  // namespace stillmesh
