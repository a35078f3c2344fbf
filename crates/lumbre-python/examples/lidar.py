"""A depth image from a camera, and a point cloud from a lidar that turns, of a scene of exact shapes."""

import numpy as np

import lumbre

scene = lumbre.Scene(
    [
        lumbre.Plane(),
        lumbre.Cylinder(p0=(2, 1, 0), p1=(2, 1, 3), radius=0.4),
        lumbre.Torus(major=1, minor=0.35, center=(-1.5, 2, 1.3), axis=(1, 1, 0.3)),
        lumbre.Capsule(p0=(-1, -2, 0.5), p1=(1, -2.5, 0.5), radius=0.5),
        lumbre.Cone(p0=(3, -2, 0), p1=(3, -2, 2), r0=1, r1=0),
    ]
)

# Depth along the camera's axis, not along the ray.
eye, target = np.array([0.0, -9.0, 4.0]), np.array([0.0, 0.0, 0.8])
origins, directions = lumbre.Perspective(eye, target=target, fov=45).rays(480, 300)
hits = scene.cast(origins.reshape(-1, 3), directions.reshape(-1, 3), tmax=40.0, fields=("t", "point"))
axis = (target - eye) / np.linalg.norm(target - eye)
depth = ((hits.point - eye) @ axis).reshape(300, 480)

# 64 beams between -25 and 15 degrees, 1800 to a turn, with the noise of a real one.
azimuth, elevation = np.meshgrid(np.radians(np.arange(0, 360, 0.2)), np.radians(np.linspace(-25, 15, 64)))
beams = np.stack([np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)], axis=-1).reshape(-1, 3)
sensor = np.array([0.0, 0.0, 1.7])
echo = scene.cast(sensor, beams, tmax=30.0, fields=("t", "shape"))
distance = (echo.t + np.random.default_rng(0).normal(scale=0.01, size=len(echo)))[echo.hit]
cloud = sensor + distance[:, None] * beams[echo.hit]
print(f"{len(cloud)} echoes of {len(beams)} beams; depth {np.nanmin(depth):.2f} to {np.nanmax(depth):.2f}")
np.save("lidar.npy", cloud)

shade = np.repeat(np.nan_to_num(np.exp(-depth / 12))[..., None], 3, axis=-1)
dots = [lumbre.Sphere(center=p, radius=0.03, material=lumbre.Diffuse((0.9, 0.4, 0.1))) for p in cloud[np.linalg.norm(cloud, axis=1) < 7]]
seen = lumbre.Scene(dots, camera=lumbre.Perspective(eye, target=target, fov=45), lights=[lumbre.EnvironmentLight(1.0)])
lumbre.write_image("lidar.png", np.vstack([shade, seen.render(spp=8, size=(480, 300)).array]))
