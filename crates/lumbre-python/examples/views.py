"""A data set of fifty views of a model: pictures, depth and camera poses, as NeRF's transforms.json has them. The tree is built once."""

import json
from pathlib import Path

import numpy as np

import lumbre

size, spp, count = (160, 120), 8, 50
scene = lumbre.Scene(
    [
        lumbre.Torus(major=1, minor=0.35, center=(0, 0, 0.35), material=lumbre.Principled((0.8, 0.35, 0.1), roughness=0.3)),
        lumbre.Sphere(center=(0, 0, 0.9), radius=0.55, material=lumbre.Metal(0.9, roughness=0.15)),
        lumbre.Box(p0=(-1.6, 0.9, 0), p1=(-0.9, 1.6, 0.7), material="teal"),
    ]
)

# Poses on a spiral around the model, in OpenGL's axes: x to the right, y upwards, z backwards.
turns = np.radians(np.linspace(0, 3 * 360, count, endpoint=False))
heights = np.radians(np.linspace(10, 60, count))
eyes = 6 * np.stack([np.cos(heights) * np.sin(turns), -np.cos(heights) * np.cos(turns), np.sin(heights)], axis=1) + [0, 0, 0.5]
backwards = (eyes - [0, 0, 0.5]) / 6
rightwards = np.cross([0.0, 0.0, 1.0], backwards)
rightwards /= np.linalg.norm(rightwards, axis=1, keepdims=True)
poses = np.tile(np.eye(4), (count, 1, 1))
poses[:, :3] = np.stack([rightwards, np.cross(backwards, rightwards), backwards, eyes], axis=2)

focal, middle = 1.4 * size[0], (size[0] / 2, size[1] / 2)
cameras = [lumbre.Perspective.from_intrinsics(focal, focal, *middle, size, pose, axes="opengl") for pose in poses]
folder = Path("views")
folder.mkdir(exist_ok=True)
frames, pictures = [], []
for number, (camera, pose) in enumerate(zip(cameras, poses, strict=True)):
    image = scene.render(spp=spp, camera=camera, features=True, denoise=True)
    image.save(folder / f"{number:03}.png")
    np.save(folder / f"{number:03}.npy", image.feature("depth"))
    frames.append({"file_path": f"views/{number:03}.png", "transform_matrix": pose.tolist()})
    pictures.append(image.array)
data = {"fl_x": focal, "fl_y": focal, "cx": middle[0], "cy": middle[1], "w": size[0], "h": size[1], "frames": frames}
Path("transforms.json").write_text(json.dumps(data, indent=1))

# What one view sees stands where another one sees it: the points of its depth, looked at from the next camera.
depth = np.load(folder / "000.npy")
v, u = np.nonzero(np.isfinite(depth))
z = depth[v, u]
local = np.stack([(u + 0.5 - middle[0]) / focal * z, -(v + 0.5 - middle[1]) / focal * z, -z, np.ones_like(z)])
world = (poses[0] @ local)[:3].T
seen = ~scene.occluded(eyes[1], world - eyes[1], tmax=0.995)
print(f"{count} views of {size[0]} x {size[1]}; {seen.mean():.0%} of what the first sees is seen by the second")

sheet = np.concatenate([np.concatenate(pictures[row::10][:3], axis=1) for row in (0, 5)])
lumbre.write_image("views.png", sheet, tonemap="neutral")
