# A camera passes a patterned wall 2 m away, 6 pixels a frame: all that it takes to follow it.
import stillmesh
from wall import wall

camera = stillmesh.Camera(640, 480, fx=525, fy=525, cx=319.5, cy=239.5)
engine = stillmesh.Engine(stillmesh.Settings("pocket"), camera, vocabulary=b"")  # no vocabulary: no place is recognised
for i in range(5):
    grey, depth = wall(6 * i)  # numpy arrays, as OpenCV and ROS give them
    pose = engine.submit(grey, depth, i * 33_333_333, depth_units_per_m=1000)
    engine.step()  # background work, until the next frame comes
    print(f"frame {i}: {pose.state}, {pose.odom_from_camera[0, 3]:.3f} m along the wall")
