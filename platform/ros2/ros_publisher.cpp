#include "platform/ros2/ros_publisher.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <system_error>
#include <thread>

#include "hal/ros2/ros_context.hpp"
#include "hal/ros2/ros_name.hpp"
#include "platform/poses/body_frames.hpp"
#include "platform/record/slot_ring.hpp"
#include "platform/ros2/ros_messages.hpp"

namespace stillmesh {
namespace {

using Clock = std::chrono::steady_clock;
constexpr std::size_t kSlots = 64;  // two seconds of a camera
constexpr std::chrono::seconds kEvery{1};

struct Slot {
    PoseReport report;
    Clock::time_point arrived;
    bool is_event = false;
    std::array<char, 200> sentence{};
};

}  // namespace

class RosPublisher::Sender {
public:
    explicit Sender(const RosOptions& options)
        : ring_(kSlots),
          messages_(options),
          has_tf_(options.has_tf),
          is_base_from_tf_(options.is_base_from_tf),
          has_grid_(options.has_grid),
          grid_(compose(options.base_from_camera_link, kLinkFromOptical)) {}
    ~Sender() { static_cast<void>(close()); }
    Sender(const Sender&) = delete;
    Sender& operator=(const Sender&) = delete;

    [[nodiscard]] bool open(const RosOptions& options, std::string& message) {
        context_ = RosContext::get(message);
        if (context_ == nullptr || !make_writers(options, message)) return false;
        try {
            thread_ = std::jthread([this] { send_all(); });
            points_thread_ = std::jthread([this](const std::stop_token& stop) { send_points(stop); });
        } catch (const std::system_error& failure) {
            message = std::string("--publish ros2: there is no thread to send from: ") + failure.what() + ".";
            return false;
        }
        return true;
    }
    [[nodiscard]] MapPoints& points() noexcept { return points_; }
    [[nodiscard]] GridShelf* grid() noexcept { return has_grid_ ? &grid_ : nullptr; }

    [[nodiscard]] std::string add(const PoseReport& report, const std::string* sentence) {
        Slot* const slot = ring_.claim();
        if (slot == nullptr) {
            ++overtaken_;
        } else {
            slot->is_event = sentence != nullptr;
            if (sentence != nullptr) {
                const std::size_t length = std::min(sentence->size(), slot->sentence.size() - 1);
                std::copy_n(sentence->data(), length, slot->sentence.data());
                slot->sentence[length] = '\0';
            } else {
                slot->report = report;
                slot->arrived = Clock::now();
            }
            ring_.publish();
        }
        if (is_said_ || overtaken_ + failures_ == 0) return {};
        is_said_ = true;
        return "--publish ros2: " + why() + "; the run goes on without these samples.";
    }

    [[nodiscard]] std::string close() {
        if (!thread_.joinable()) return {};
        ring_.close();
        points_thread_.request_stop();
        thread_.join();
        if (points_thread_.joinable()) points_thread_.join();
        // What was sent last still reaches whoever reads, and nobody is waited for longer than that.
        const Clock::time_point end = Clock::now() + kEvery;
        for (const dds_entity_t writer : writers_) {
            if (writer <= 0) continue;
            const std::chrono::nanoseconds left = std::max(end - Clock::now(), Clock::duration::zero());
            static_cast<void>(dds_wait_for_acks(writer, left.count()));
            static_cast<void>(dds_delete(writer));
        }
        context_.reset();
        if (overtaken_ + failures_ == 0) return {};
        return fmt::format("--publish ros2: {}; {} samples were lost.", why(), overtaken_ + failures_);
    }

private:
    enum Topic : std::uint8_t { kOdometry, kTf, kStaticTf, kPose, kPath, kPoints, kMap, kDiagnostics, kTopics };

    [[nodiscard]] bool make_writers(const RosOptions& options, std::string& message) {
        const std::string own = options.name_space.empty() ? "" : "/" + options.name_space;
        const struct {
            Topic topic;
            std::string name;
            const dds_topic_descriptor_t& type;
            RosQos qos;
        } all[] = {
            {kOdometry, own + "/odom", ros::kOdometry, {}},
            {kTf, "/tf", ros::kTf, {.depth = 100}},
            {kStaticTf, "/tf_static", ros::kTf, {.history = RosHistory::kLatched, .depth = 1}},
            {kPose, own + "/stillmesh/pose", ros::kPoseWithCovarianceStamped, {}},
            {kPath, own + "/stillmesh/path", ros::kPath, {.history = RosHistory::kLatched, .depth = 1}},
            {kPoints, own + "/stillmesh/points", ros::kPointCloud, {.history = RosHistory::kLatched, .depth = 1}},
            {kMap, own + "/map", ros::kOccupancyGrid, {.history = RosHistory::kLatched, .depth = 1}},
            {kDiagnostics, "/diagnostics", ros::kDiagnosticArray, {}},
        };
        for (const auto& [topic, name, type, qos] : all) {
            if (!has_tf_ && (topic == kTf || topic == kStaticTf)) continue;
            if (is_base_from_tf_ && topic == kStaticTf) continue;
            if (!has_grid_ && topic == kMap) continue;  // another program's
            writers_[topic] = context_->writer(name, type, qos, message);
            if (writers_[topic] >= 0) continue;
            message = "--publish ros2: " + message;
            return false;
        }
        return true;
    }

    [[nodiscard]] std::string why() const {
        if (overtaken_ > 0) return "frames came faster than they could be sent";
        return std::string("Cyclone DDS did not send: ") + dds_strretcode(first_failure_);
    }

    void send(Topic topic, const void* message) {
        if (writers_[topic] <= 0) return;
        const dds_return_t code = dds_write(writers_[topic], message);
        if (code >= 0) return;
        if (failures_++ == 0) first_failure_ = code;
    }

    void send_frame(const Slot& slot) {
        arrived_ = slot.arrived;
        time_ns_ = slot.report.estimate.time_ns;
        if (!messages_.frame(slot.report)) return;
        send(kTf, &messages_.tf());  // first: who hears of the pose may ask for the transform at once
        send(kOdometry, &messages_.odometry());
        send(kPose, &messages_.pose());
    }

    void send_slow(Clock::time_point now) {
        if (arrived_ == Clock::time_point{}) return;
        const double silent_s = std::chrono::duration<double>(now - arrived_).count();
        send(kDiagnostics, &messages_.diagnostics(silent_s, overtaken_ + failures_));
        send(kPath, &messages_.path());
    }
    // Reading a copy takes some 20 ms, which poses should not wait for: on a thread of its own.
    void send_points(const std::stop_token& stop) {
        constexpr std::chrono::milliseconds kLook{50};
        std::vector<ShownPoint> points;
        Clock::time_point next = Clock::now();
        while (!stop.stop_requested()) {
            std::this_thread::sleep_for(kLook);
            if (points_.take(points)) send(kPoints, &messages_.points(points, time_ns_));
            if (const ShownGrid* const grid = grid_.take()) send(kMap, &messages_.grid(*grid, time_ns_));
            dds_publication_matched_status_t matched{};
            if (Clock::now() < next || dds_get_publication_matched_status(writers_[kPoints], &matched) < 0) continue;
            next = Clock::now() + kEvery;
            if (matched.current_count > 0) points_.ask();
        }
    }

    void send_all() {
        send(kStaticTf, &messages_.static_tf());
        Clock::time_point next = Clock::now();
        while (!ring_.is_done()) {
            if (const Slot* const slot = ring_.wait_until(next)) {
                if (slot->is_event) {
                    messages_.event(slot->sentence.data());
                } else {
                    send_frame(*slot);
                }
                ring_.release();
            }
            const Clock::time_point now = Clock::now();
            if (now < next) continue;
            send_slow(now);
            next = now + kEvery;
        }
        send_slow(Clock::now());  // the end of the path
    }

    SlotRing<Slot> ring_;
    RosMessages messages_;
    bool has_tf_, is_base_from_tf_, has_grid_;
    std::shared_ptr<RosContext> context_;
    std::array<dds_entity_t, kTopics> writers_{};
    MapPoints points_;
    GridShelf grid_;
    Clock::time_point arrived_{};            // of the last frame
    std::atomic<std::int64_t> time_ns_ = 0;  // its own
    std::atomic<std::uint64_t> overtaken_ = 0, failures_ = 0;
    std::atomic<dds_return_t> first_failure_ = DDS_RETCODE_OK;
    bool is_said_ = false;
    std::jthread thread_, points_thread_;
};

RosPublisher::RosPublisher() = default;
RosPublisher::~RosPublisher() = default;

bool RosPublisher::open(const RosOptions& options, std::string& message) {
    if (!options.name_space.empty() && (options.name_space.front() == '/' || !is_ros_name(options.name_space))) {
        message = "--ros-namespace " + options.name_space + ": give a name as ROS 2 allows it, such as robot1.";
        return false;
    }
    auto sender = std::make_unique<Sender>(options);
    if (!sender->open(options, message)) return false;
    sender_ = std::move(sender);
    return true;
}

MapPoints* RosPublisher::points() noexcept {
    return sender_ != nullptr ? &sender_->points() : nullptr;
}

GridShelf* RosPublisher::grid() noexcept {
    return sender_ != nullptr ? sender_->grid() : nullptr;
}

std::string RosPublisher::frame(const PoseReport& report) {
    return sender_ != nullptr ? sender_->add(report, nullptr) : std::string();
}

std::string RosPublisher::event(const std::string& sentence) {
    return sender_ != nullptr ? sender_->add({}, &sentence) : std::string();
}

std::string RosPublisher::close() {
    return sender_ != nullptr ? sender_->close() : std::string();
}

}  // namespace stillmesh
