#include "platform/cli/motion_of_run.hpp"

#include <filesystem>
#include <system_error>
#include <utility>

#include "platform/motion/accelerometer_file.hpp"
#include "platform/motion/motion_file.hpp"
#include "platform/ros2/ros2_module.hpp"

namespace stillmesh {
namespace {

[[nodiscard]] bool read_files(const RunArguments& arguments, const std::string& folder,
                              std::unique_ptr<MotionSource>& motion, std::string& message) {
    auto read = std::make_unique<MotionFile>();
    bool is_any = false;
    for (const bool is_odometry : {true, false}) {
        std::string file = is_odometry ? arguments.odometry : arguments.gyroscope;
        std::error_code error;
        if (file.empty() && !folder.empty()) {
            file = folder + (is_odometry ? "/odometry.txt" : "/gyro.txt");
            if (!std::filesystem::exists(file, error)) continue;
        }
        if (file.empty() || file == "none") continue;
        if ((is_odometry ? read->read_odometry(file, message) : read->read_gyroscope(file, message)) != Status::kOk) {
            message += std::string(" (") + (is_odometry ? "--odometry" : "--gyro") + " none: without it.)";
            return false;
        }
        is_any = true;
    }
    read->set_errors(arguments.motion_errors);
    if (is_any) motion = std::move(read);
    return true;
}

// Empty: `message` says why.
[[nodiscard]] std::unique_ptr<RosMotion> hear(const RosMotionOptions& options, std::string& message) {
    const Ros2Module* const module = ros2_module(message);
    std::unique_ptr<RosMotion> heard = module != nullptr ? module->motion() : nullptr;
    return heard != nullptr && heard->open(options, message) ? std::move(heard) : nullptr;
}

}  // namespace

bool is_ros_motion(const std::string& value) {
    return !ros_motion_topic(value, "/").empty();
}

std::string motion_problem(const RunArguments& arguments) {
    if (!arguments.accelerometer.empty() && arguments.session.grid.level != Level::kGravity)
        return "--accelerometer: says where up is, which --level gravity asks for; give both.";
    const std::string& camera = arguments.live.camera;
    for (const auto& [option, value] : {std::pair<const char*, const std::string&>{"--odometry", arguments.odometry},
                                        {"--gyro", arguments.gyroscope},
                                        {"--accelerometer", arguments.accelerometer}}) {
        if (value.empty()) continue;
        if (is_ros_motion(value)) {
            if (camera.starts_with("ros2")) continue;
            return std::string(option) + " " + value + ": has ROS's times; give --camera ros2 with it.";
        }
        if (!camera.empty()) {
            return std::string(option) +
                   ": a file knows no live camera; give --replay DIR or --simulate SCENE, or a "
                   "topic of ROS 2 beside --camera ros2.";
        }
    }
    return {};
}

bool open_motion(const RunArguments& arguments, const std::string& folder, std::unique_ptr<MotionSource>& motion,
                 std::string& message) {
    RosMotionOptions options;
    options.odometry = ros_motion_topic(arguments.odometry, "/odom_in");
    options.imu = ros_motion_topic(arguments.gyroscope, "/imu");
    if (options.odometry.empty() && options.imu.empty()) return read_files(arguments, folder, motion, message);
    options.errors = arguments.motion_errors;
    options.base_from_camera_link = arguments.loop.ros.base_from_camera_link;
    motion = hear(options, message);
    if (motion == nullptr) {
        message = (options.odometry.empty() ? "--gyro ros2: " : "--odometry ros2: ") + message;
        return false;
    }
    return true;
}

bool open_accelerometer(const RunArguments& arguments, const std::string& folder,
                        std::unique_ptr<AccelerationSource>& source, std::string& message) {
    if (arguments.session.grid.level != Level::kGravity) return true;
    if (const std::string topic = ros_motion_topic(arguments.accelerometer, "/imu"); !topic.empty()) {
        RosMotionOptions options;
        options.accelerometer = topic;
        options.base_from_camera_link = arguments.loop.ros.base_from_camera_link;
        source = hear(options, message);
        if (source == nullptr) {
            message = "--accelerometer ros2: " + message;
            return false;
        }
        return true;
    }
    if (!arguments.live.camera.empty()) {
        message =
            "--level gravity: needs an accelerometer; give --accelerometer ros2 beside --camera ros2, or a file beside "
            "--replay DIR or --simulate SCENE.";
        return false;
    }
    std::error_code error;
    const std::string own = folder.empty() ? "" : folder + "/accelerometer.txt";
    const std::string file =
        arguments.accelerometer.empty() && std::filesystem::exists(own, error) ? own : arguments.accelerometer;
    if (file.empty()) {
        message =
            "--level gravity: needs an accelerometer; give --accelerometer FILE, or a recording that has "
            "accelerometer.txt.";
        return false;
    }
    auto list = std::make_unique<AccelerationList>();
    if (read_accelerometer(file, list->readings, message) != Status::kOk) return false;
    source = std::move(list);
    return true;
}

bool place_on_robot(const RunArguments& arguments, std::optional<RunArguments>& placed, std::string& message) {
    const std::size_t colon = arguments.live.camera.find(':');
    const std::string topics = colon == std::string::npos ? "" : arguments.live.camera.substr(colon + 1);
    const RosBaseQuestion question{.topics = topics, .base = arguments.loop.ros.frame_prefix + "base_link"};
    const Ros2Module* const module = ros2_module(message);
    const auto pose = module != nullptr ? module->base_from_camera(question, message) : std::nullopt;
    if (!pose) {
        message = "--base-from-camera tf_static: " + message;
        return false;
    }
    placed = arguments;
    placed->loop.ros.base_from_camera_link = placed->loop.mavlink.base_from_camera_link = *pose;
    return true;
}

}  // namespace stillmesh
