"""Hears what `stillmesh run --publish ros2` says on /odom, until nothing has come for five seconds: ros2_listener.py MESSAGES.
With ROS 2 installed a node of rclpy does this; Debian has Cyclone DDS for C alone, and ctypes calls it. How MESSAGES
are made of hal/ros2/messages.idl: docs/guide.md.
"""
import ctypes
import math
import os
import sys
import time
from ctypes import byref, c_char, c_char_p, c_double, c_int32, c_int64, c_size_t, c_uint32, c_void_p
from ctypes.util import find_library

dds, messages = ctypes.CDLL(find_library("ddsc")), ctypes.CDLL(os.path.abspath(sys.argv[1]))


class Odometry(ctypes.Structure):
    """nav_msgs/Odometry as idlc lays it out, as far as it is read here."""
    _fields_ = [("sec", c_int32), ("nanosec", c_uint32), ("frame_id", c_char_p), ("child_frame_id", c_char_p),
                ("position", c_double * 3), ("orientation", c_double * 4), ("covariance", c_double * 36)]


class SampleInfo(ctypes.Structure):
    """dds_sample_info_t."""
    _fields_ = [("states", c_int32 * 3), ("is_valid", ctypes.c_bool), ("source_timestamp", c_int64), ("handles", c_int64 * 2),
                ("counts", c_uint32 * 5)]


def reader_of(topic_name, kind):
    participant = dds.dds_create_participant(c_uint32(int(os.environ.get("ROS_DOMAIN_ID", "0"))), None, None)
    topic = dds.dds_create_topic(participant, byref(c_char.in_dll(messages, kind + "_desc")), topic_name, None, None)
    dds.dds_create_qos.restype = c_void_p
    qos = c_void_p(dds.dds_create_qos())
    dds.dds_qset_reliability(qos, 1, c_int64(10**9))  # reliable
    dds.dds_qset_history(qos, 0, 100)  # keep the last
    reader = dds.dds_create_reader(participant, topic, qos, None)
    dds.dds_delete_qos(qos)
    return reader if reader > 0 else sys.exit(f"no reader: {reader}")


reader = reader_of(b"rt/odom", "nav_msgs_msg_dds__Odometry_")  # ROS calls it /odom
end = time.monotonic() + 60
while time.monotonic() < end:
    sample, info = c_void_p(), SampleInfo()  # the sample is borrowed until it is given back
    if dds.dds_take(reader, byref(sample), byref(info), c_size_t(1), c_uint32(1)) <= 0:
        time.sleep(0.01)
        continue
    if info.is_valid:
        odometry = Odometry.from_address(sample.value)
        x, y, _ = odometry.position
        print(f"{odometry.sec}.{odometry.nanosec:09}: {x:.2f} m ahead, {y:.2f} m to the left, "
              f"+- {math.sqrt(odometry.covariance[0]):.3f} m")
    dds.dds_return_loan(reader, byref(sample), 1)
    end = time.monotonic() + 5
dds.dds_delete(1)  # DDS_CYCLONEDDS_HANDLE: all of it
