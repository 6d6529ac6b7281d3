# Yesterday a map was made and saved; today the camera is found in it, and its poses are those of the map.
import os
import tempfile

import stillmesh
from wall import wall

camera = stillmesh.Camera(640, 480, fx=525, fy=525, cx=319.5, cy=239.5)
settings = stillmesh.Settings("pocket")
with tempfile.TemporaryDirectory() as folder:
    file = os.path.join(folder, "wall.map")

    yesterday = stillmesh.Engine(settings, camera)  # with the library's vocabulary: by its words a place is found again
    for i in range(40):
        yesterday.submit(*wall(6 * i), i * 33_333_333)
        yesterday.step()
    yesterday.save_map(file)

    today = stillmesh.Engine(settings, camera)
    today.load_map(file, localise=True)  # the map stays as it is
    for i in range(20):
        pose = today.submit(*wall(100 + 6 * i), 10**12 + i * 33_333_333)
        today.step()
        if pose.state != "none" and i % 4 == 0:
            print(f"frame {i}: {pose.state}, {pose.map_from_camera[0, 3]:.3f} m along the wall of the map")
