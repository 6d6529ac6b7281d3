// A recording in the layout of the TUM RGB-D benchmark, played as a depth camera: rgb.txt and depth.txt list "seconds
// file", colour is PNG, JPEG or what else image_reader.hpp reads (of 16-bit grey the high byte), depth 16-bit PNG, PGM
// or NumPy, of colour's size or a whole multiple or fraction of it: then the nearest pixel counts; or of the depth
// camera that the camera file names: then it is registered here. Frames come as fast as they are polled; nothing is
// skipped but colour images without a depth image within 20 ms. Without those lists associations.txt is read, which has
// both, or a folder of images that are called after their times or numbers (image_folder.hpp). The calibration is a
// file or name given by the caller, else camera.toml or camera.yaml in the folder; with none, open() refuses rather
// than guesses. A folder mask/ is taken for a detector's masks (mask_folder.hpp). Memory: two image buffers and 32
// bytes per frame, all taken in open(). Every failure leaves a sentence in message().
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "hal/depth_camera.hpp"
#include "hal/live/depth_registration.hpp"
#include "hal/replay/frame_list.hpp"
#include "hal/replay/image_reader.hpp"
#include "hal/replay/mask_folder.hpp"

namespace stillmesh {

struct ReplayOptions {
    std::string folder;
    std::string calibration;                           // file or built-in name; empty: the folder's own
    std::optional<CameraInfo> camera = std::nullopt;   // known from elsewhere: nothing is read
    double depth_units_per_m = 0;                      // instead of the camera file's; 0: as it says
    std::uint32_t width_max = 640;                     // px; larger images are refused
    std::uint32_t height_max = 480;                    // px
    std::int64_t association_gap_max_ns = 20'000'000;  // between a colour image and its depth image
    std::int64_t depth_offset_ns = 0;     // what depth's clock is ahead of colour's: taken off depth's times
    double frames_per_s = 0;              // of lists that number frames; 0: they are refused
    std::string masks = {};               // their folder; empty: mask/, if it is there; "none": without
    std::int64_t gap_ns = 1'000'000'000;  // silence between two frames that counts as a gap
};

struct ReplayCounts {
    std::uint32_t colour_images = 0;
    std::uint32_t depth_images = 0;
    std::uint32_t frames = 0;  // pairs; the others are skipped
    std::uint32_t masks = 0;   // of them, with a mask
    std::uint32_t gaps = 0;    // longer than gap_ns
    std::int64_t gap_longest_ns = 0;
    std::int64_t gap_longest_after_ns = 0;  // time of the last frame before it
    std::int64_t first_ns = 0;
    std::int64_t last_ns = 0;
    std::int64_t pair_gap_longest_ns = 0;  // between the images of a pair
    TimeUnit unit = TimeUnit::kSeconds;    // of the times in the colour list
    double step = 0;                       // of these times, in that unit
    std::uint32_t depth_width = 0;         // px, of the depth images as they are
    std::uint32_t depth_height = 0;
    bool is_colour_wide = false;  // 16-bit grey
    bool is_registered_here = false;
};

class ReplayCamera final : public DepthCamera {
public:
    explicit ReplayCamera(ReplayOptions options);
    ~ReplayCamera();
    ReplayCamera(const ReplayCamera&) = delete;
    ReplayCamera& operator=(const ReplayCamera&) = delete;

    // kUnavailable: folder, list or first image missing.    kInvalid: lists, calibration, sizes.    kCorrupt: a PNG.
    [[nodiscard]] Status open() noexcept override;
    [[nodiscard]] const CameraInfo& info() const noexcept override;
    // kOk, kEnd; kCorrupt: an image of the next frame cannot be used: the frame is skipped, and polling may go on;
    // kUnavailable: not open, or a listed image is missing (skipped as well).
    [[nodiscard]] Status poll(Frame& frame) noexcept override;
    // A recording never lets anyone wait: kOk, or kEnd after the last frame.
    [[nodiscard]] Status wait(std::uint32_t timeout_ms) noexcept override;
    void close() noexcept override;

    // What went wrong last, as a sentence with file, problem and remedy; empty after success.
    [[nodiscard]] const std::string& message() const noexcept { return message_; }
    [[nodiscard]] const ReplayCounts& counts() const noexcept { return counts_; }
    // Where the calibration came from: a file or a built-in name.
    [[nodiscard]] const std::string& calibration_source() const noexcept { return calibration_source_; }
    [[nodiscard]] std::int64_t frame_time_ns(std::size_t index) const noexcept { return pairs_[index].colour.time_ns; }

private:
    static constexpr int kColour = 0, kDepth = 1;  // of the lists
    [[nodiscard]] Status open_folder();
    [[nodiscard]] Status find_calibration();
    [[nodiscard]] Status find_pairs();
    [[nodiscard]] Status read_associations(const std::string& file);
    [[nodiscard]] Status pair_lists(const char* colour_list, const char* depth_list);
    [[nodiscard]] Status read_file(int list, const std::string& file, std::string& text);
    [[nodiscard]] Status read_images(int list, const char* name, std::string& text);
    [[nodiscard]] Status read_list(int list, const char* name, std::vector<ListedImage>& images, ListTimes& times);
    [[nodiscard]] Status find_first_images();
    [[nodiscard]] Status find_masks();
    [[nodiscard]] Status check_images();
    [[nodiscard]] Status check_sizes();
    [[nodiscard]] Status check_depth_size();
    [[nodiscard]] bool is_of_separate_depth() const noexcept;
    [[nodiscard]] Status read_pair(const ImagePair& pair, Frame& frame);
    [[nodiscard]] Status image_path(int list, const ListedImage& image, std::string& path);

    ReplayOptions options_;
    CameraInfo info_;
    std::string calibration_source_;
    std::string message_;
    std::string colour_file_, depth_file_;  // that said what all are like
    std::string path_;                      // reused: no allocation per frame once it has grown
    ReplayCounts counts_;
    std::vector<ImagePair> pairs_;
    MaskFolder masks_;
    std::size_t next_ = 0;
    ImageHeader colour_header_;
    ImageHeader depth_header_;
    std::vector<std::uint8_t> colour_pixels_;
    std::vector<std::uint16_t> colour_wide_;  // of 16-bit grey; else empty
    std::vector<std::uint16_t> depth_read_;   // as it is, if it is not as colour; else empty
    std::optional<DepthRegistration> registration_;
    std::vector<std::uint16_t> depth_pixels_;
    int lists_[2] = {-1, -1};  // rgb.txt and depth.txt stay open: names are read from them when needed
    std::string list_names_[2];
    bool is_open_ = false;
};

}  // namespace stillmesh
