# Hears the poses of `stillmesh run --poses udp:127.0.0.1:5600`, until none has come for five seconds: poses_udp.py [PORT]
import json
import socket
import sys

poses = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
poses.bind(("127.0.0.1", int(sys.argv[1]) if len(sys.argv) > 1 else 5600))
poses.settimeout(60)
try:
    while True:
        pose = json.loads(poses.recv(4096))  # a datagram is a line of docs/poses.md
        poses.settimeout(5)
        if pose["type"] != "pose":
            continue  # an event, in words
        if pose["state"] == "none":
            print(f"frame {pose['frame']}: no pose, {pose['reason']}: stop")
            continue
        x, y, z = pose["map_from_camera"]["p"]
        print(f"frame {pose['frame']}: {pose['state']}, {x:.2f} m right, {z:.2f} m ahead of the start")
except TimeoutError:
    pass
