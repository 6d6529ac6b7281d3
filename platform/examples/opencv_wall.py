# cv::Mat in, pose out: OpenCV's images are numpy arrays, BGR or grey, and go into the engine as they are, without a copy.
import cv2
import numpy as np
import stillmesh
from wall import wall

camera = stillmesh.Camera(640, 480, fx=525, fy=525, cx=319.5, cy=239.5)
engine = stillmesh.Engine(stillmesh.Settings("pocket"), camera)
for i in range(5):
    grey, depth = wall(6 * i)
    _, colour_png = cv2.imencode(".png", cv2.cvtColor(grey, cv2.COLOR_GRAY2BGR))  # as files and cameras give them
    _, depth_png = cv2.imencode(".png", depth)

    bgr = cv2.imdecode(colour_png, cv2.IMREAD_COLOR)  # cv2.imread(FILE), or VideoCapture.read()
    millimetres = cv2.imdecode(depth_png, cv2.IMREAD_UNCHANGED)  # uint16; of float metres: (1000 * metres).astype(np.uint16)
    assert millimetres.dtype == np.uint16
    pose = engine.submit(bgr, millimetres, i * 33_333_333, depth_units_per_m=1000, is_bgr=True)
    engine.step()  # background work, until the next frame comes
    print(f"frame {i}: {pose.state}, {pose.odom_from_camera[0, 3]:.3f} m along the wall")
