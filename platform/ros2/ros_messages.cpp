#include "platform/ros2/ros_messages.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstring>
#include <limits>

namespace stillmesh {
namespace {

constexpr std::int64_t kSecond_ns = 1'000'000'000;
constexpr std::int64_t kPathEvery_ns = 100'000'000;  // at first
constexpr double kSilent_s = 1.0;                    // without a frame: then the state is out of date
constexpr std::uint8_t kFloat32 = 7;                 // sensor_msgs/PointField
constexpr std::size_t kPointBytes = 3 * sizeof(float);
enum Level : std::uint8_t { kOk = 0, kWarn = 1, kError = 2, kStale = 3 };

// Messages are C structs, which have no const; nobody writes to what is sent.
[[nodiscard]] char* text(const char* literal) {
    return const_cast<char*>(literal);
}

template <typename Sequence, typename Items>
void point_to(Sequence& sequence, Items& items) {
    sequence._maximum = sequence._length = static_cast<std::uint32_t>(items.size());
    sequence._buffer = items.data();
    sequence._release = false;
}

void set(ros::Pose& out, const RigidTransform& pose) {
    const auto& [x, y, z, w] = pose.rotation_xyzw;
    out = {{pose.translation_m[0], pose.translation_m[1], pose.translation_m[2]}, {x, y, z, w}};
}

template <typename... Arguments>
void print(std::array<char, 256>& out, fmt::format_string<Arguments...> format, Arguments&&... arguments) {
    const auto end = fmt::format_to_n(out.data(), out.size() - 1, format, std::forward<Arguments>(arguments)...);
    *end.out = '\0';
}

}  // namespace

RosMessages::RosMessages(const RosOptions& options)
    : frames_(options.base_from_camera_link),
      course_(frames_),
      map_(options.frame_prefix + "map"),
      odom_(options.frame_prefix + "odom"),
      base_(options.frame_prefix + "base_link"),
      link_(options.frame_prefix + "camera_link"),
      optical_(options.frame_prefix + "camera_color_optical_frame"),
      path_every_ns_(kPathEvery_ns) {
    path_poses_.reserve(kPathPosesMax);
    point_to(tf_.transforms, transforms_);
    point_to(static_tf_.transforms, static_transforms_);
    header(static_transforms_[0].header, base_, 0);
    transform(static_transforms_[0], base_, link_, options.base_from_camera_link);
    header(static_transforms_[1].header, link_, 0);
    transform(static_transforms_[1], link_, optical_, kLinkFromOptical);
    constexpr const char* kFields[] = {"x", "y", "z"};
    for (std::uint32_t i = 0; i < fields_.size(); ++i) {
        fields_[i] = {text(kFields[i]), i * static_cast<std::uint32_t>(sizeof(float)), kFloat32, 1};
    }
    point_to(cloud_.fields, fields_);
    cloud_.height = 1;
    cloud_.point_step = kPointBytes;
    cloud_.is_dense = true;
    base_from_optical_ = compose(options.base_from_camera_link, kLinkFromOptical);
    constexpr const char* kKeys[kValues] = {"state",   "reason",  "frame",  "map",          "features",
                                            "matches", "inliers", "moving", "samples lost", "last event"};
    for (std::size_t i = 0; i < kValues; ++i) values_[i] = {text(kKeys[i]), texts_[i].text.data()};
    point_to(status_.values, values_);
    status_.name = text("stillmesh: tracking");
    status_.hardware_id = text("stillmesh");
    status_.message = message_.text.data();
    diagnostics_.status = {1, 1, &status_, false};
}

void RosMessages::header(ros::Header& header, std::string& frame_id, std::int64_t time_ns) {
    constexpr std::int64_t kSecondsMax = std::numeric_limits<std::int32_t>::max();  // ROS's times end in 2038
    header.stamp.sec = static_cast<std::int32_t>(std::min(time_ns / kSecond_ns, kSecondsMax));
    header.stamp.nanosec = static_cast<std::uint32_t>(time_ns % kSecond_ns);
    header.frame_id = frame_id.data();
}

void RosMessages::transform(ros::TransformStamped& out, std::string& parent, std::string& child,
                            const RigidTransform& pose) {
    out.header.frame_id = parent.data();
    out.child_frame_id = child.data();
    const auto& [x, y, z, w] = pose.rotation_xyzw;
    out.transform = {{pose.translation_m[0], pose.translation_m[1], pose.translation_m[2]}, {x, y, z, w}};
}

bool RosMessages::frame(const PoseReport& report) {
    const PoseEstimate& estimate = report.estimate;
    const BodyStep& step = course_.follow(report);
    const bool has_pose = report.state != PoseState::kNone;
    if (has_pose) {
        fill(frames_.of_base(estimate.odom_from_camera), frames_.of_base(estimate.map_from_odom), step.covariance);
        twist(step);
        header(odometry_.header, odom_, estimate.time_ns);
        header(transforms_[0].header, map_, estimate.time_ns);
        header(transforms_[1].header, odom_, estimate.time_ns);
        header(pose_.header, map_, estimate.time_ns);
        add_to_path(report.map, pose_.pose.pose, estimate.time_ns);
    }
    has_frame_ = true;
    last_ = report;
    return has_pose;
}

void RosMessages::fill(const RigidTransform& odom_from_base, const RigidTransform& map_from_odom,
                       const Covariance6& doubted) {
    const RigidTransform map_from_base = compose(map_from_odom, odom_from_base);
    transform(transforms_[0], map_, odom_, map_from_odom);
    transform(transforms_[1], odom_, base_, odom_from_base);
    odometry_.child_frame_id = base_.data();
    set(odometry_.pose.pose, odom_from_base);
    set(pose_.pose.pose, map_from_base);
    const Covariance6 in_odom = in_parent(doubted, odom_from_base);
    const Covariance6 in_map = in_parent(doubted, map_from_base);
    std::copy(in_odom.begin(), in_odom.end(), odometry_.pose.covariance);
    std::copy(in_map.begin(), in_map.end(), pose_.pose.covariance);
}

void RosMessages::twist(const BodyStep& step) {
    const auto& [v, w] = step.velocity;
    odometry_.twist.twist = {{v[0], v[1], v[2]}, {w[0], w[1], w[2]}};
    for (std::size_t i = 0; i < step.covariance.size(); ++i) {
        const bool is_diagonal = i % 7 == 0;
        odometry_.twist.covariance[i] = step.is_next ? step.velocity_covariance[i] : is_diagonal ? kUnknownVariance : 0;
    }
}

void RosMessages::add_to_path(std::size_t map, const ros::Pose& pose, std::int64_t time_ns) {
    if (map != path_map_) path_poses_.clear();
    if (path_poses_.empty()) path_every_ns_ = kPathEvery_ns;
    path_map_ = map;
    if (!path_poses_.empty()) {
        const auto& stamp = path_poses_.back().header.stamp;
        if (time_ns - (stamp.sec * kSecond_ns + stamp.nanosec) < path_every_ns_) return;
    }
    if (path_poses_.size() == kPathPosesMax) {  // the whole way at half the density
        for (std::size_t i = 0; i < kPathPosesMax / 2; ++i) path_poses_[i] = path_poses_[2 * i];
        path_poses_.resize(kPathPosesMax / 2);
        path_every_ns_ *= 2;
    }
    ros::PoseStamped& added = path_poses_.emplace_back();
    header(added.header, map_, time_ns);
    added.pose = pose;
}

const ros::Path& RosMessages::path() {
    header(path_.header, map_, last_.estimate.time_ns);
    point_to(path_.poses, path_poses_);
    return path_;
}

const ros::PointCloud& RosMessages::points(const std::vector<ShownPoint>& points, std::int64_t time_ns) {
    cloud_bytes_.resize(points.size() * kPointBytes);
    for (std::size_t i = 0; i < points.size(); ++i) {
        const std::array<double, 3> p = frames_.point(points[i].in_map_m);
        const float xyz[3] = {static_cast<float>(p[0]), static_cast<float>(p[1]), static_cast<float>(p[2])};
        std::memcpy(cloud_bytes_.data() + i * kPointBytes, xyz, kPointBytes);
    }
    header(cloud_.header, map_, time_ns);
    cloud_.width = static_cast<std::uint32_t>(points.size());
    cloud_.row_step = cloud_.width * cloud_.point_step;
    point_to(cloud_.data, cloud_bytes_);
    return cloud_;
}

const ros::OccupancyGrid& RosMessages::grid(const ShownGrid& grid, std::int64_t time_ns) {
    header(grid_.header, map_, time_ns);
    grid_.info.map_load_time = grid_.header.stamp;
    grid_.info.resolution = static_cast<float>(grid.resolution_m);
    grid_.info.width = grid.width;
    grid_.info.height = grid.height;
    set(grid_.info.origin, compose(base_from_optical_, grid.map_from_grid));
    const auto count = static_cast<std::uint32_t>(grid.cells.size());
    // Signed in ROS's definition, octets on the wire.
    auto* const cells = const_cast<std::uint8_t*>(reinterpret_cast<const std::uint8_t*>(grid.cells.data()));
    grid_.data = {count, count, cells, false};
    return grid_;
}

const ros::DiagnosticArray& RosMessages::diagnostics(double silent_s, std::uint64_t lost) {
    header(diagnostics_.header, no_frame_, last_.estimate.time_ns + static_cast<std::int64_t>(silent_s * 1e9));
    const char* const state = pose_state_name(last_.state);
    const bool is_tracked = last_.state == PoseState::kTracked;
    if (!has_frame_ || silent_s > kSilent_s) {
        status_.level = kStale;
        print(message_.text, "no frame for {:.1f} s", silent_s);
    } else {
        status_.level = is_tracked ? kOk : last_.state == PoseState::kNone ? kError : kWarn;
        const bool has_reason = !is_tracked && std::strcmp(last_.reason, "none") != 0;
        print(message_.text, "{}{}{}", state, has_reason ? ": " : "", has_reason ? last_.reason : "");
    }
    const FrameStatistics& statistics = last_.statistics;
    print(texts_[0].text, "{}", state);
    print(texts_[1].text, "{}", is_tracked ? "none" : last_.reason);
    print(texts_[2].text, "{}", last_.frame);
    print(texts_[3].text, "{}", last_.map);
    print(texts_[4].text, "{}", statistics.features);
    print(texts_[5].text, "{}", statistics.matches);
    print(texts_[6].text, "{}", statistics.static_matches);
    print(texts_[7].text, "{}", statistics.dynamic_matches);
    print(texts_[8].text, "{}", lost);
    print(texts_[9].text, "{}", event_.text.data());
    return diagnostics_;
}

void RosMessages::event(const char* sentence) {
    print(event_.text, "{}", sentence);
}

}  // namespace stillmesh
