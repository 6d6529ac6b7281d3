// A bag of ROS, played as a depth camera: bags of ROS 1, and of ROS 2 as SQLite or MCAP (bag_reader.hpp), also in
// several files (bag_files.hpp). Topics are named or found (topic_choice.hpp), the camera is the bag's CameraInfo
// unless a calibration is given. A frame is a colour image and the depth image nearest to it by the stamps of their
// headers, as ReplayCamera pairs them; frames come as fast as they are polled, in the order of time. Depth of a camera
// of its own is registered to colour, where the bag or the calibration says how it stands.
// Limits: a bag is read once from front to back, so that a partner is looked for among the images that lie at most
// kWaitingMax images of its stream away. Memory: two image buffers, the reader's chunk, and the images that wait for
// a partner, three a stream where streams are in step, never more than kWaitingBytesMax; it does not grow with the
// length of the bag. Every failure leaves a sentence in message().
// A build without the libraries (STILLMESH_WITH_BAGS) has this class, which then refuses to open.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "hal/depth_camera.hpp"

namespace stillmesh {

struct BagOptions {
    std::string path;                                  // file or folder
    std::string topics;                                // COLOUR,DEPTH,INFO or COLOUR,DEPTH; empty: found
    std::string calibration;                           // file or built-in name; empty: the bag's own
    std::optional<CameraInfo> camera = std::nullopt;   // known from elsewhere
    double depth_units_per_m = 0;                      // of depth as it comes out; 0: as the bag or the camera says
    std::uint32_t width_max = 640;                     // px; larger images are refused
    std::uint32_t height_max = 480;                    // px
    std::int64_t association_gap_max_ns = 20'000'000;  // between a colour image and its depth image
    std::int64_t depth_offset_ns = 0;                  // what depth's clock is ahead of colour's
};

struct BagCounts {
    std::uint64_t colour_images = 0;  // read so far
    std::uint64_t depth_images = 0;
    std::uint64_t frames = 0;         // pairs
    std::uint64_t lonely_colour = 0;  // without a depth image
    std::uint64_t times_back = 0;     // images whose time repeats or goes backwards: passed over
    std::uint64_t damages = 0;        // pieces of the bag that could not be read
    std::int64_t pair_gap_longest_ns = 0;
};

class BagCamera final : public DepthCamera {
public:
    static constexpr std::size_t kWaitingMax = 32;  // images of a stream
    static constexpr std::size_t kWaitingBytesMax = std::size_t{256} << 20U;

    explicit BagCamera(BagOptions options);
    ~BagCamera();
    BagCamera(const BagCamera&) = delete;
    BagCamera& operator=(const BagCamera&) = delete;

    // kUnavailable: no such file, or this build has no bags.    kInvalid: topics, camera, sizes, depth that is not
    // registered, or no pair.
    [[nodiscard]] Status open() noexcept override;
    [[nodiscard]] const CameraInfo& info() const noexcept override;
    // kOk, kEnd; kCorrupt: an image cannot be used, or a piece of the bag cannot be read: polling may go on.
    // kTimedOut: no pair among the next messages, there may be one behind them.    kUnavailable: not open.
    [[nodiscard]] Status poll(Frame& frame) noexcept override;
    // A recording never lets anyone wait: kOk, or kEnd after the last frame.
    [[nodiscard]] Status wait(std::uint32_t timeout_ms) noexcept override;
    void close() noexcept override;

    // What went wrong last, as a sentence; empty after success.
    [[nodiscard]] const std::string& message() const noexcept;
    [[nodiscard]] const BagCounts& counts() const noexcept;
    // Where the calibration came from: a topic, a file or a built-in name.
    [[nodiscard]] const std::string& calibration_source() const noexcept;
    // What is not as in every recording: known after open(), and known at the end.
    [[nodiscard]] std::vector<std::string> notes() const;
    [[nodiscard]] std::vector<std::string> closing_notes() const;

private:
    struct Inside;
    std::unique_ptr<Inside> inside_;
};

}  // namespace stillmesh
