#include "hal/ros2/ros_image_session.hpp"

#include <algorithm>
#include <exception>

#include "hal/calibration/ros_topics.hpp"
#include "hal/ros2/messages.hpp"
#include "hal/ros2/packed_images.hpp"
#include "hal/ros2/ros2_images.hpp"
#include "hal/ros2/ros_loan.hpp"

namespace stillmesh {
namespace {

using live::monotonic_ns;

constexpr std::size_t kStampsForRate = 5;
constexpr std::int64_t kPeriodMin_us = 4'000, kPeriodMax_us = 1'000'000;
constexpr RosQos kSensorData{.is_reliable = false, .depth = 4};

[[nodiscard]] RosPixelsOnLoan take_from(RosShelf& shelf) {
    constexpr std::size_t kImages = 16;  // more than ever are out: giving back asks for no memory
    const std::lock_guard lock(shelf.mutex);
    shelf.free.reserve(kImages);
    if (shelf.free.empty()) return {new RosPixels, BackToShelf{&shelf}};
    RosPixels* const pixels = shelf.free.back().release();
    shelf.free.pop_back();
    return {pixels, BackToShelf{&shelf}};
}

[[nodiscard]] std::int64_t time_of(const ros::Header& header) {
    return std::int64_t{header.stamp.sec} * 1'000'000'000 + header.stamp.nanosec;
}

[[nodiscard]] RosImageView view_of(const ros::Image& image) {
    return {image.width,
            image.height,
            image.step,
            image.is_bigendian != 0,
            text_of(image.encoding),
            {image.data._buffer, image.data._length}};
}

// The pixels of a message, in either form. False: `why`.
[[nodiscard]] bool fill(const ros::Image& message, bool is_colour, RosPixels& out, std::string& why) {
    out.width = message.width;
    out.height = message.height;
    return is_colour ? colour_of(view_of(message), out.colour, out.format, why)
                     : depth_of(view_of(message), out.depth, out.units_per_m, why);
}
[[nodiscard]] bool fill(const ros::CompressedImage& message, bool is_colour, RosPixels& out, std::string& why) {
    const RosPackedView view{text_of(message.format), {message.data._buffer, message.data._length}};
    ImageHeader header;
    const bool is_good = is_colour ? packed_colour_of(view, out.colour, header, why)
                                   : packed_depth_of(view, out.depth, header, out.units_per_m, why);
    out.width = header.width;
    out.height = header.height;
    out.format = header.kind == ImageKind::kGrey8 ? PixelFormat::kGrey8 : PixelFormat::kRgb8;
    return is_good;
}

[[nodiscard]] RosLensView view_of(const ros::CameraInfo& lens) {
    const auto& roi = lens.roi;
    const bool is_cut = lens.binning_x > 1 || lens.binning_y > 1 || roi.x_offset != 0 || roi.y_offset != 0 ||
                        (roi.width != 0 && roi.width != lens.width) || (roi.height != 0 && roi.height != lens.height);
    return {lens.width,
            lens.height,
            text_of(lens.distortion_model),
            {lens.d._buffer, lens.d._length},
            std::span<const double, 9>(lens.k),
            is_cut};
}

}  // namespace

Ros2Camera::Session::Session(Ros2Options given_options) : options(std::move(given_options)) {
    names = {options.colour, options.depth, options.info, info_beside(options.depth)};
}

Ros2Camera::Session::~Session() {
    {
        const std::lock_guard lock(mutex);
        is_closing = true;
    }
    if (thread.joinable()) thread.join();
    release_images();  // to shelves that are still there
}

bool Ros2Camera::Session::is_matched(std::size_t stream) const {
    dds_subscription_matched_status_t status{};
    return readers[stream] <= 0 ||
           (dds_get_subscription_matched_status(readers[stream], &status) >= 0 && status.current_count > 0);
}

std::string Ros2Camera::Session::unmatched() const {
    std::string quiet;
    for (std::size_t i = 0; i < kNeeded; ++i) {
        if (!is_matched(i)) quiet += (quiet.empty() ? "" : ", ") + names[i];
    }
    return quiet;
}

std::string Ros2Camera::Session::silent() const {
    const std::int64_t now_ns = monotonic_ns();
    std::string quiet;
    for (std::size_t i = 0; i < kNeeded; ++i) {
        const bool is_wanted = readers[i] > 0 && (i != kLens || !has_lens);
        if (!is_wanted || now_ns - last_ns[i] < 500'000'000) continue;
        quiet += (quiet.empty() ? "" : ", ") + names[i];
    }
    return quiet;
}

bool Ros2Camera::Session::subscribe(const RosContext& context, std::string& message) {
    const auto image_type = [this](Stream stream) {
        return is_packed_topic(names[stream]) ? &ros::kCompressedImage : &ros::kImage;
    };
    const dds_topic_descriptor_t* const types[kStreams] = {image_type(kColour), image_type(kDepth), &ros::kCameraInfo,
                                                           &ros::kCameraInfo};
    for (std::size_t i = 0; i < kStreams; ++i) {
        if (i >= kLens && !options.calibration.empty()) continue;
        if (i == kDepthLens && names[kDepthLens] == names[kLens]) continue;
        readers[i] = all.add(context, names[i], *types[i], kSensorData, message);
        if (readers[i] < 0) return false;
    }
    if (options.calibration.empty() && !frames.listen(all, context, options.depth, message)) return false;
    thread = std::jthread([this] { serve(); });
    return true;
}

void Ros2Camera::Session::serve() noexcept {
    if (options.thread_begins) options.thread_begins();
    for (;;) {
        all.wait();
        {
            const std::lock_guard lock(mutex);
            counts.reader_cpu_ns = live::clock_ns(CLOCK_THREAD_CPUTIME_ID);
            if (is_closing) return;
        }
        try {
            while (take_lens(kLens) || take_lens(kDepthLens) || take_frames()) {
            }
            // In turns: of a burst each stream keeps its order.
            for (bool is_any = true; is_any;) {
                const bool is_colour = take_image(kColour);
                is_any = take_image(kDepth) || is_colour;
            }
        } catch (const std::exception&) {
            const std::lock_guard lock(mutex);
            problem = "there is no memory for its images.";
        }
    }
}

bool Ros2Camera::Session::take_lens(Stream stream) {
    if (readers[stream] <= 0) return false;
    const RosLoan<ros::CameraInfo> loan(readers[stream]);
    if (loan.message() == nullptr) return loan.is_any();
    RosLensView view = view_of(*loan.message());
    std::array<double, 9> rectified{};
    // Images without the lens's distortion are of the camera P; K and D are of those that it was taken out of.
    if (const auto& p = loan.message()->p; is_rectified_name(names[stream == kLens ? kColour : kDepth]) && p[0] != 0) {
        rectified = {p[0], p[1], p[2], p[4], p[5], p[6], p[8], p[9], p[10]};
        view.k = rectified;
        view.d = {};
    }
    CameraInfo info;
    std::string why;
    const std::lock_guard lock(mutex);
    last_ns[stream] = monotonic_ns();
    bool& is_known = stream == kLens ? has_lens : has_depth_lens;
    if (is_known) return true;
    if (lens_of(view, info, why) == Status::kOk) {
        (stream == kLens ? lens : depth_lens) = info;
        is_known = true;
    } else if (stream == kLens) {
        problem = options.info + ": " + why;
    }
    changed.notify_all();
    return true;
}

bool Ros2Camera::Session::take_frames() {
    const std::lock_guard lock(mutex);
    const bool is_any = frames.take();
    if (is_any) changed.notify_all();
    return is_any;
}

bool Ros2Camera::Session::take_image(Stream stream) {
    return is_packed_topic(names[stream]) ? take_as<ros::CompressedImage>(stream) : take_as<ros::Image>(stream);
}

template <typename Message>
bool Ros2Camera::Session::take_as(Stream stream) {
    const RosLoan<Message> loan(readers[stream]);
    if (loan.message() == nullptr) return loan.is_any();
    const Message& message = *loan.message();
    const std::int64_t arrival_ns = monotonic_ns();
    Image image = take_from(shelves[stream == kColour ? 0 : 1]);
    image->time_ns = time_of(message.header);
    std::string why;
    const bool is_good = fill(message, stream == kColour, *image, why);
    const std::lock_guard lock(mutex);
    if (is_good && image->time_ns > 0) {
        frame_ids[stream] = text_of(message.header.frame_id);
        take_in(stream, std::move(image), arrival_ns);
    } else {
        ++counts.images_unusable;
        problem = names[stream] + ": an image " + (is_good ? "has no time." : why);
    }
    changed.notify_all();
    return true;
}

// The median of some intervals, as the stamps have them: half of it is what images of a pair may lie apart.
void Ros2Camera::Session::learn_rate(std::int64_t time_us, std::int64_t arrival_ns) {
    if (stamps_us.empty() || time_us > stamps_us.back()) stamps_us.push_back(time_us);
    if (stamps_us.size() < kStampsForRate) return;
    std::array<std::int64_t, kStampsForRate - 1> intervals{};
    for (std::size_t i = 0; i + 1 < kStampsForRate; ++i) intervals[i] = stamps_us[i + 1] - stamps_us[i];
    std::sort(intervals.begin(), intervals.end());
    period_us = std::clamp(intervals[intervals.size() / 2], kPeriodMin_us, kPeriodMax_us);
    begin(period_us, arrival_ns);
}

void Ros2Camera::Session::take_in(Stream stream, Image image, std::int64_t arrival_ns) {
    last_ns[stream] = arrival_ns;
    const std::int64_t time_us = image->time_ns / 1000;
    if (period_us == 0) {
        ++(stream == kColour ? counts.images_colour : counts.images_depth);
        if (stream == kColour) learn_rate(time_us, arrival_ns);
        return;
    }
    bool is_pair = false;
    static_cast<void>(add(stream == kColour, std::move(image), time_us, arrival_ns, is_pair));
}

}  // namespace stillmesh
