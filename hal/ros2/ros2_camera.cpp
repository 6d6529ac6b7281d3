#include "hal/ros2/ros2_camera.hpp"

#include <algorithm>
#include <array>
#include <exception>
#include <thread>
#include <utility>
#include <vector>

#include "hal/calibration/calibration.hpp"
#include "hal/live/live_session.hpp"
#include "hal/ros2/messages.hpp"
#include "hal/ros2/packed_images.hpp"
#include "hal/ros2/ros2_images.hpp"
#include "hal/ros2/ros_loan.hpp"
#include "hal/ros2/ros_name.hpp"
#include "hal/ros2/ros_readers.hpp"

namespace stillmesh {
namespace {

using live::monotonic_ns;

constexpr std::size_t kStampsForRate = 5;
constexpr std::int64_t kPeriodMin_us = 4'000, kPeriodMax_us = 1'000'000;
constexpr RosQos kSensorData{.is_reliable = false, .depth = 4};

// An image of either kind.
struct Pixels {
    std::int64_t time_ns = 0;
    std::uint32_t width = 0, height = 0;
    PixelFormat format = PixelFormat::kGrey8;
    double units_per_m = 0;
    std::vector<std::uint8_t> colour;
    std::vector<std::uint16_t> depth;
};
// They change hands and come back, each with the memory that it has: five of a kind are there at most.
struct Shelf {
    std::mutex mutex;
    std::vector<std::unique_ptr<Pixels>> free;
};
struct BackToShelf {
    Shelf* shelf = nullptr;
    void operator()(Pixels* pixels) const noexcept {
        const std::lock_guard lock(shelf->mutex);
        shelf->free.emplace_back(pixels);
    }
};
using Image = std::unique_ptr<Pixels, BackToShelf>;

[[nodiscard]] Image take_from(Shelf& shelf) {
    constexpr std::size_t kImages = 16;  // more than ever are out: giving back asks for no memory
    const std::lock_guard lock(shelf.mutex);
    shelf.free.reserve(kImages);
    if (shelf.free.empty()) return {new Pixels, BackToShelf{&shelf}};
    Pixels* const pixels = shelf.free.back().release();
    shelf.free.pop_back();
    return {pixels, BackToShelf{&shelf}};
}

[[nodiscard]] std::int64_t time_of(const ros::Header& header) {
    return std::int64_t{header.stamp.sec} * 1'000'000'000 + header.stamp.nanosec;
}

[[nodiscard]] std::string_view text_of(const char* text) {
    return text != nullptr ? std::string_view(text) : std::string_view();
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
[[nodiscard]] bool fill(const ros::Image& message, bool is_colour, Pixels& out, std::string& why) {
    out.width = message.width;
    out.height = message.height;
    return is_colour ? colour_of(view_of(message), out.colour, out.format, why)
                     : depth_of(view_of(message), out.depth, out.units_per_m, why);
}
[[nodiscard]] bool fill(const ros::CompressedImage& message, bool is_colour, Pixels& out, std::string& why) {
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

struct Ros2Camera::Session : live::LiveSession<Image> {
    enum Stream : std::uint8_t { kColour, kDepth, kLens, kStreams };

    Ros2Options options;
    std::array<dds_entity_t, kStreams> readers{};
    RosReaders all;
    bool has_lens = false;  // this and all below: under the mutex
    std::string problem;    // frames came that cannot be used
    CameraInfo lens;
    Shelf shelf;
    std::vector<std::int64_t> stamps_us;           // of colour, until the rate is known
    std::int64_t period_us = 0;                    // 0: not known yet
    std::array<std::int64_t, kStreams> last_ns{};  // when one came
    std::jthread thread;

    explicit Session(Ros2Options given_options) : options(std::move(given_options)) {}
    ~Session() {
        {
            const std::lock_guard lock(mutex);
            is_closing = true;
        }
        if (thread.joinable()) thread.join();
        release_images();  // to a shelf that is still there
    }
    Session(const Session&) = delete;
    Session& operator=(const Session&) = delete;

    [[nodiscard]] bool subscribe(const RosContext& context, std::string& message);
    [[nodiscard]] const std::string& name(std::size_t stream) const {
        return stream == kColour ? options.colour : stream == kDepth ? options.depth : options.info;
    }
    // Somebody publishes there.
    [[nodiscard]] bool is_matched(std::size_t stream) const {
        dds_subscription_matched_status_t status{};
        return readers[stream] <= 0 ||
               (dds_get_subscription_matched_status(readers[stream], &status) >= 0 && status.current_count > 0);
    }
    [[nodiscard]] std::string unmatched() const {
        std::string names;
        for (std::size_t i = 0; i < kStreams; ++i) {
            if (!is_matched(i)) names += (names.empty() ? "" : ", ") + name(i);
        }
        return names;
    }

    void serve() noexcept;

private:
    bool take_lens();
    bool take_image(Stream stream);
    template <typename Message>
    bool take_as(Stream stream);
    void take_in(Stream stream, Image image, std::int64_t arrival_ns);
    void learn_rate(std::int64_t time_us, std::int64_t arrival_ns);
};

bool Ros2Camera::Session::subscribe(const RosContext& context, std::string& message) {
    const auto image_type = [this](Stream stream) {
        return is_packed_topic(name(stream)) ? &ros::kCompressedImage : &ros::kImage;
    };
    const dds_topic_descriptor_t* const types[kStreams] = {image_type(kColour), image_type(kDepth), &ros::kCameraInfo};
    for (std::size_t i = 0; i < kStreams; ++i) {
        if (i == kLens && !options.calibration.empty()) continue;
        readers[i] = all.add(context, name(i), *types[i], kSensorData, message);
        if (readers[i] < 0) return false;
    }
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
            while (take_lens()) {
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

bool Ros2Camera::Session::take_lens() {
    if (readers[kLens] <= 0) return false;
    const RosLoan<ros::CameraInfo> loan(readers[kLens]);
    if (loan.message() == nullptr) return loan.is_any();
    CameraInfo info;
    std::string why;
    const std::lock_guard lock(mutex);
    last_ns[kLens] = monotonic_ns();
    if (has_lens) return true;
    if (lens_of(view_of(*loan.message()), info, why) == Status::kOk) {
        lens = info;
        has_lens = true;
    } else {
        problem = options.info + ": " + why;
    }
    changed.notify_all();
    return true;
}

bool Ros2Camera::Session::take_image(Stream stream) {
    return is_packed_topic(name(stream)) ? take_as<ros::CompressedImage>(stream) : take_as<ros::Image>(stream);
}

template <typename Message>
bool Ros2Camera::Session::take_as(Stream stream) {
    const RosLoan<Message> loan(readers[stream]);
    if (loan.message() == nullptr) return loan.is_any();
    const Message& message = *loan.message();
    const std::int64_t arrival_ns = monotonic_ns();
    Image image = take_from(shelf);
    image->time_ns = time_of(message.header);
    std::string why;
    const bool is_good = fill(message, stream == kColour, *image, why);
    const std::lock_guard lock(mutex);
    if (is_good && image->time_ns > 0) {
        take_in(stream, std::move(image), arrival_ns);
    } else {
        ++counts.images_unusable;
        problem = name(stream) + ": an image " + (is_good ? "has no time." : why);
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

Ros2Camera::Ros2Camera(Ros2Options options) : options_(std::move(options)) {}

Ros2Camera::~Ros2Camera() {
    close();
}

Status Ros2Camera::refuse(Status status, std::string why) {
    message_ = std::move(why);
    return status;
}

Status Ros2Camera::open() noexcept {
    close();
    try {
        const Status status = begin();
        if (status != Status::kOk) session_.reset();
        return status;
    } catch (const std::exception&) {
        session_.reset();
        message_ = "ROS 2's images cannot be had: no memory or no thread.";
        return Status::kUnavailable;
    }
}

Status Ros2Camera::begin() {
    std::string why;
    if (context_ == nullptr) context_ = RosContext::get(why);
    if (context_ == nullptr) return refuse(Status::kInvalid, why);
    if (!options_.calibration.empty() && load_calibration(options_.calibration, info_, why) != Status::kOk) {
        return refuse(Status::kInvalid, why);
    }
    session_ = std::make_unique<Session>(options_);
    Session& session = *session_;
    if (!session.subscribe(*context_, why)) return refuse(Status::kInvalid, why);
    std::unique_lock lock(session.mutex);
    const bool needs_lens = options_.calibration.empty();
    const auto is_there = [&] { return session.slot && (session.has_lens || !needs_lens); };
    static_cast<void>(session.changed.wait_for(lock, std::chrono::milliseconds(options_.open_max_ms),
                                               [&] { return is_there() || !session.problem.empty(); }));
    if (!is_there()) {
        if (!session.problem.empty()) return refuse(Status::kInvalid, session.problem);
        lock.unlock();
        const std::string nobody = session.unmatched();
        if (!nobody.empty()) {
            return refuse(Status::kUnavailable, "nobody publishes " + nobody +
                                                    ": is the driver running, with this ROS_DOMAIN_ID? Other topics: "
                                                    "--camera ros2:COLOUR,DEPTH,INFO.");
        }
        return refuse(Status::kUnavailable,
                      silence().empty() ? "no colour image of ROS 2 has a depth image of its time." : silence());
    }
    if (needs_lens) info_ = session.lens;
    const Pixels& colour = *session.slot->colour;
    const Pixels& depth = *session.slot->depth;
    const auto size = [](std::uint32_t width, std::uint32_t height) {
        return std::to_string(width) + "x" + std::to_string(height);
    };
    CameraModel& model = info_.model;
    if (model.width == 0 && model.height == 0) model.width = colour.width, model.height = colour.height;
    if (model.width != colour.width || model.height != colour.height) {
        return refuse(Status::kInvalid, (needs_lens ? options_.info : options_.calibration) + " is for " +
                                            size(model.width, model.height) + ", " + options_.colour + " is " +
                                            size(colour.width, colour.height) + ".");
    }
    if (depth.width != colour.width || depth.height != colour.height) {
        return refuse(Status::kInvalid, options_.depth + " is " + size(depth.width, depth.height) + ", " +
                                            options_.colour + " is " + size(colour.width, colour.height) +
                                            ": give the topic of depth that is aligned to colour.");
    }
    info_.depth_units_per_m = depth.units_per_m;
    info_.frames_per_s = 1e6 / static_cast<double>(session.period_us);
    return refuse(Status::kOk, "");
}

Status Ros2Camera::poll(Frame& frame) noexcept {
    if (session_ == nullptr) return Status::kUnavailable;
    const live::CpuMeter meter(before_.poll_cpu_ns);
    Session& session = *session_;
    if (session.take(message_) != Status::kOk) {
        if (session.is_matched(Session::kColour) && session.is_matched(Session::kDepth)) return Status::kTimedOut;
        return refuse(Status::kUnavailable, "nobody publishes " + session.unmatched() + " any more");
    }
    // What is given is nobody else's until the next poll.
    const Pixels& colour = *session.given->colour;
    const Pixels& depth = *session.given->depth;
    due_ns_ = session.given->taken_ns;
    frame.time_ns = colour.time_ns;
    frame.depth_time_ns = depth.time_ns;
    frame.format = colour.format;
    frame.colour = {colour.colour.data(), colour.width, colour.height,
                    std::size_t{channels_of(colour.format)} * colour.width};
    frame.depth = {depth.depth.data(), depth.width, depth.height, depth.width};
    frame.depth_units_per_m = depth.units_per_m;
    return Status::kOk;
}

Status Ros2Camera::wait(std::uint32_t timeout_ms) noexcept {
    return session_ != nullptr ? session_->wait(timeout_ms) : Status::kUnavailable;
}

void Ros2Camera::close() noexcept {
    if (session_ == nullptr) return;
    before_ = counts();
    session_.reset();
}

std::int64_t Ros2Camera::next_due_ns() noexcept {
    return session_ != nullptr ? session_->next_due_ns(monotonic_ns()) : monotonic_ns() + period_ns();
}

std::string Ros2Camera::silence() const {
    if (session_ == nullptr) return {};
    const std::lock_guard lock(session_->mutex);
    const std::int64_t now_ns = monotonic_ns();
    std::string quiet;
    for (std::size_t i = 0; i < Session::kStreams; ++i) {
        const bool is_wanted = session_->readers[i] > 0 && (i != Session::kLens || !session_->has_lens);
        if (!is_wanted || now_ns - session_->last_ns[i] < 500'000'000) continue;
        quiet += (quiet.empty() ? "" : ", ") + session_->name(i);
    }
    return quiet.empty() ? quiet : "nothing comes on " + quiet;
}

std::string Ros2Camera::device() const {
    return "ROS 2 topics " + options_.colour + " and " + options_.depth + ", " + std::to_string(info_.model.width) +
           "x" + std::to_string(info_.model.height) + "@" + std::to_string(static_cast<int>(info_.frames_per_s + 0.5));
}

std::string Ros2Camera::calibration_source() const {
    return options_.calibration.empty() ? options_.info : options_.calibration;
}

LiveCounts Ros2Camera::counts() const noexcept {
    LiveCounts sum = before_;
    if (session_ != nullptr) sum.add(session_->counted());
    return sum;
}

bool parse_ros2_topics(const std::string& text, Ros2Options& options) {
    const std::size_t first = text.find(',');
    const std::size_t second = first == std::string::npos ? first : text.find(',', first + 1);
    if (second == std::string::npos) return false;
    options.colour = text.substr(0, first);
    options.depth = text.substr(first + 1, second - first - 1);
    options.info = text.substr(second + 1);
    for (std::string* const name : {&options.colour, &options.depth, &options.info}) {
        if (!is_ros_name(*name)) return false;
        if (name->front() != '/') name->insert(0, "/");
    }
    return true;
}

}  // namespace stillmesh
