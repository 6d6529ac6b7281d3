// The messages of messages.idl, as Cyclone's compiler makes them in C, under names that read well. Inner: what includes
// this sees Cyclone's headers.
#pragma once

#include <dds/dds.h>
#include <stillmesh_ros2_messages/messages.h>

#include <cstdint>

namespace stillmesh::ros {

using Header = std_msgs_msg_dds__Header_;
using Bool = std_msgs_msg_dds__Bool_;
using Empty = std_msgs_msg_dds__Empty_;
using Pose = geometry_msgs_msg_dds__Pose_;
using PoseStamped = geometry_msgs_msg_dds__PoseStamped_;
using PoseWithCovarianceStamped = geometry_msgs_msg_dds__PoseWithCovarianceStamped_;
using Transform = geometry_msgs_msg_dds__Transform_;
using TransformStamped = geometry_msgs_msg_dds__TransformStamped_;
using Tf = tf2_msgs_msg_dds__TFMessage_;
using Odometry = nav_msgs_msg_dds__Odometry_;
using Path = nav_msgs_msg_dds__Path_;
using OccupancyGrid = nav_msgs_msg_dds__OccupancyGrid_;
using PointField = sensor_msgs_msg_dds__PointField_;
using PointCloud = sensor_msgs_msg_dds__PointCloud2_;
using Image = sensor_msgs_msg_dds__Image_;
using CompressedImage = sensor_msgs_msg_dds__CompressedImage_;
using Imu = sensor_msgs_msg_dds__Imu_;
using CameraInfo = sensor_msgs_msg_dds__CameraInfo_;
using KeyValue = diagnostic_msgs_msg_dds__KeyValue_;
using DiagnosticStatus = diagnostic_msgs_msg_dds__DiagnosticStatus_;
using DiagnosticArray = diagnostic_msgs_msg_dds__DiagnosticArray_;

inline const dds_topic_descriptor_t& kPoseWithCovarianceStamped =
    geometry_msgs_msg_dds__PoseWithCovarianceStamped__desc;
inline const dds_topic_descriptor_t& kTf = tf2_msgs_msg_dds__TFMessage__desc;
inline const dds_topic_descriptor_t& kOdometry = nav_msgs_msg_dds__Odometry__desc;
inline const dds_topic_descriptor_t& kPath = nav_msgs_msg_dds__Path__desc;
inline const dds_topic_descriptor_t& kOccupancyGrid = nav_msgs_msg_dds__OccupancyGrid__desc;
inline const dds_topic_descriptor_t& kBool = std_msgs_msg_dds__Bool__desc;
inline const dds_topic_descriptor_t& kEmpty = std_msgs_msg_dds__Empty__desc;
inline const dds_topic_descriptor_t& kPointCloud = sensor_msgs_msg_dds__PointCloud2__desc;
inline const dds_topic_descriptor_t& kImage = sensor_msgs_msg_dds__Image__desc;
inline const dds_topic_descriptor_t& kCompressedImage = sensor_msgs_msg_dds__CompressedImage__desc;
inline const dds_topic_descriptor_t& kImu = sensor_msgs_msg_dds__Imu__desc;
inline const dds_topic_descriptor_t& kCameraInfo = sensor_msgs_msg_dds__CameraInfo__desc;
inline const dds_topic_descriptor_t& kDiagnosticArray = diagnostic_msgs_msg_dds__DiagnosticArray__desc;

}  // namespace stillmesh::ros
