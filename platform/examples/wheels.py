# A robot drives along a wall that its camera looks at, and its wheels say how far: evidence for the engine, frame by frame.
import stillmesh
from wall import wall

camera = stillmesh.Camera(640, 480, fx=525, fy=525, cx=319.5, cy=239.5)
engine = stillmesh.Engine(stillmesh.Settings("pocket"), camera, vocabulary=b"")
TICK_M = 0.0001  # what a wheel rolls from one tick of its encoder to the next
ticks_then = 0
for i in range(5):
    ticks = 228 * i  # both wheels: it drives straight on
    driven_m = (ticks - ticks_then) * TICK_M
    ticks_then = ticks
    # The camera looks to the side: its x axis is where the robot drives. 2 % of slip, and half a millirad of turn.
    hint = stillmesh.Hint((driven_m, 0, 0), sigma_m=0.02 * driven_m + 1e-4, sigma_rad=5e-4)
    grey, depth = wall(6 * i)
    pose = engine.submit(grey, depth, i * 33_333_333, hint=hint if i > 0 else None)
    engine.step()
    print(f"frame {i}: {pose.state}, {pose.odom_from_camera[0, 3]:.3f} m, by the wheels {ticks * TICK_M:.3f} m")
