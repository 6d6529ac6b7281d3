#include "platform/cli/prepared_camera.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <optional>
#include <utility>
#include <vector>

#include "hal/replay/image_reader.hpp"

namespace stillmesh {
namespace {

constexpr std::uint8_t kWhite = 128;  // from here on
constexpr double kCoveredMax = 0.95;  // of the picture: nothing would be left to track
constexpr double kCoveredUsual = 0.6;

[[nodiscard]] Status read_mask(const std::string& file, const CameraModel& camera, std::vector<std::uint8_t>& mask,
                               std::string& message) {
    ImageHeader header;
    STILLMESH_TRY(read_image_header(file, header, message));
    if (header.width != camera.width || header.height != camera.height) {
        message = fmt::format("--mask {}: is {}x{}, the images are {}x{}; draw it on one of them.", file, header.width,
                              header.height, camera.width, camera.height);
        return Status::kInvalid;
    }
    const std::size_t pixels = std::size_t{camera.width} * camera.height;
    if (header.kind == ImageKind::kGrey16) {
        message = fmt::format("--mask {}: is 16-bit grey, as depth is; save it with 8 bits.", file);
        return Status::kInvalid;
    }
    const std::size_t channels = header.kind == ImageKind::kRgb8 ? 3 : 1;
    std::vector<std::uint8_t> image(pixels * channels);
    STILLMESH_TRY(read_image(file, header, image, message));
    mask.resize(pixels);
    for (std::size_t i = 0; i < pixels; ++i) {
        const std::uint8_t* const at = &image[i * channels];
        mask[i] = std::any_of(at, at + channels, [](std::uint8_t c) { return c >= kWhite; }) ? 255 : 0;
    }
    return Status::kOk;
}

}  // namespace

bool is_mask_of_frames(const std::string& mask) {
    std::error_code error;
    return mask == "none" || std::filesystem::is_directory(mask, error);
}

Status PreparedCamera::prepare(const std::string& mask, bool is_half, std::string& note, std::string& message) {
    if (camera_->info().is_depth_older) {
        moved_ = std::make_unique<MovedDepthCamera>(*camera_);
        camera_ = moved_.get();
    }
    if (!mask.empty() && !is_mask_of_frames(mask)) {
        std::vector<std::uint8_t> pixels;
        STILLMESH_TRY(read_mask(mask, camera_->info().model, pixels, message));
        const auto white = std::count(pixels.begin(), pixels.end(), std::uint8_t{255});
        const double share = static_cast<double>(white) / static_cast<double>(pixels.size());
        if (share > kCoveredMax) {
            message = fmt::format(
                "--mask {}: {:.0f} % of it are white, and what is white is not looked at; turn it "
                "round.",
                mask, 100 * share);
            return Status::kInvalid;
        }
        note = fmt::format("{:.1f} % of the picture are masked{}.", 100 * share,
                           share > kCoveredUsual ? ": is white where nothing is to be looked at?" : "");
        masked_ = std::make_unique<MaskedCamera>(*camera_, std::move(pixels));
        camera_ = masked_.get();
    }
    if (is_half) {
        half_ = std::make_unique<HalfCamera>(*camera_);
        camera_ = half_.get();
    }
    return Status::kOk;
}

void PreparedCamera::learn(const PoseEstimate& pose) noexcept {
    if (moved_ == nullptr) return;
    const bool is_measured = pose.state >= PoseState::kUnsure;
    moved_->learn(pose.time_ns, is_measured ? std::optional(pose.odom_from_camera) : std::nullopt);
}

}  // namespace stillmesh
