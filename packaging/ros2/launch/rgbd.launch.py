"""ros2 launch stillmesh rgbd.launch.py: tracks the images of a running depth camera driver and publishes odometry.

It starts the program with its own options: it is no node of rclcpp and knows no --ros-args.
"""
import os

from ament_index_python.packages import get_package_prefix
from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, ExecuteProcess
from launch.substitutions import LaunchConfiguration

ARGUMENTS = {
    "colour": ("/camera/color/image_raw", "colour images: rgb8, bgr8 or mono8"),
    "depth": ("/camera/aligned_depth_to_color/image_raw", "depth aligned to colour: 16UC1 or 32FC1"),
    "info": ("/camera/color/camera_info", "CameraInfo of the colour images"),
    "base_from_camera": ("0,0,0", "camera_link on base_link: x,y,z or x,y,z,qx,qy,qz,qw, or tf_static: as the robot says"),
    "tf": ("--tf", "--tf, or --no-tf where another program publishes odom -> base_link"),
    "limits": ("room", "room, or pocket for a small board"),
}


def generate_launch_description():
    value = {name: LaunchConfiguration(name) for name in ARGUMENTS}
    program = os.path.join(get_package_prefix("stillmesh"), "lib", "stillmesh", "stillmesh")
    arguments = [DeclareLaunchArgument(name, default_value=default, description=text)
                 for name, (default, text) in ARGUMENTS.items()]
    # Substitutions in one list are joined to one word.
    camera = ["ros2:", value["colour"], ",", value["depth"], ",", value["info"]]
    command = [program, "run", "--camera", camera, "--wait", "--publish", "ros2",
               "--base-from-camera", value["base_from_camera"], value["tf"], "--limits", value["limits"]]
    return LaunchDescription(arguments + [ExecuteProcess(cmd=command, output="screen")])
