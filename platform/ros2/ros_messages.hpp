// ROS's messages of what a run gives out. Fields are filled in place: strings and sequences point into what this class
// holds, so that no message takes memory once it is made. Inner: sees Cyclone's headers. One thread, but for points()
// and grid().
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "hal/ros2/messages.hpp"
#include "platform/poses/body_course.hpp"
#include "platform/poses/pose_line.hpp"
#include "platform/ros2/map_points.hpp"
#include "platform/ros2/ros_publisher.hpp"
#include "platform/ros2/shown_grid.hpp"

namespace stillmesh {

class RosMessages {
public:
    static constexpr std::size_t kPathPosesMax = 1024;

    explicit RosMessages(const RosOptions& options);
    RosMessages(const RosMessages&) = delete;
    RosMessages& operator=(const RosMessages&) = delete;

    // The next frame. True: it has a pose, which the first three below are of.
    bool frame(const PoseReport& report);
    [[nodiscard]] const ros::Odometry& odometry() const { return odometry_; }
    [[nodiscard]] const ros::Tf& tf() const { return tf_; }
    [[nodiscard]] const ros::PoseWithCovarianceStamped& pose() const { return pose_; }

    [[nodiscard]] const ros::Tf& static_tf() const { return static_tf_; }
    // Where base_link was, in the map of now, as it was given out then.
    [[nodiscard]] const ros::Path& path();
    // These two may be called by another thread than the others.
    [[nodiscard]] const ros::PointCloud& points(const std::vector<ShownPoint>& points, std::int64_t time_ns);
    // Its cells are borrowed.
    [[nodiscard]] const ros::OccupancyGrid& grid(const ShownGrid& grid, std::int64_t time_ns);
    // `silent_s`: since the last frame came; `lost`: samples that were not sent.
    [[nodiscard]] const ros::DiagnosticArray& diagnostics(double silent_s, std::uint64_t lost);
    void event(const char* sentence);

private:
    static constexpr std::size_t kValues = 10;
    struct Value {
        std::array<char, 256> text{};
    };

    void header(ros::Header& header, std::string& frame_id, std::int64_t time_ns);
    void transform(ros::TransformStamped& out, std::string& parent, std::string& child, const RigidTransform& pose);
    void fill(const RigidTransform& odom_from_base, const RigidTransform& map_from_odom, const Covariance6& doubted);
    void twist(const BodyStep& step);
    void add_to_path(std::size_t map, const ros::Pose& pose, std::int64_t time_ns);

    BodyFrames frames_;
    BodyCourse course_;
    std::string map_, odom_, base_, link_, optical_, no_frame_;  // names of frames
    PoseReport last_;
    bool has_frame_ = false;

    ros::Odometry odometry_{};
    ros::PoseWithCovarianceStamped pose_{};
    ros::Tf tf_{}, static_tf_{};
    std::array<ros::TransformStamped, 2> transforms_{}, static_transforms_{};
    ros::Path path_{};
    std::vector<ros::PoseStamped> path_poses_;
    std::size_t path_map_ = 0;
    std::int64_t path_every_ns_ = 0;
    ros::PointCloud cloud_{};
    std::array<ros::PointField, 3> fields_{};
    std::vector<std::uint8_t> cloud_bytes_;
    ros::OccupancyGrid grid_{};
    RigidTransform base_from_optical_;
    ros::DiagnosticArray diagnostics_{};
    ros::DiagnosticStatus status_{};
    std::array<ros::KeyValue, kValues> values_{};
    std::array<Value, kValues> texts_{};
    Value message_, event_;
};

}  // namespace stillmesh
