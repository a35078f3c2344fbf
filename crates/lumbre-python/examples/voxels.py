"""A voxel grid of a mesh, by what is inside: right where the mesh has a hole as well, by the winding number."""

import numpy as np

import lumbre

# A torus as a mesh with a patch missing.
u, v = np.meshgrid(np.linspace(0, 2 * np.pi, 64, endpoint=False), np.linspace(0, 2 * np.pi, 32, endpoint=False), indexing="ij")
ring = 1.5 + 0.6 * np.cos(v)
vertices = np.stack([ring * np.cos(u), ring * np.sin(u), 0.6 * np.sin(v)], axis=-1).reshape(-1, 3)
i, j = np.meshgrid(np.arange(64), np.arange(32), indexing="ij")
a, b, c, d = (((i + p) % 64 * 32 + (j + q) % 32).reshape(-1) for p, q in ((0, 0), (1, 0), (1, 1), (0, 1)))
faces = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
faces = faces[np.linalg.norm(vertices[faces].mean(axis=1) - [0, -1.5, 0.6], axis=1) > 0.3]
scene = lumbre.Scene(lumbre.Mesh(vertices, faces))

step = 0.1
axes = [np.arange(-limit, limit, step) + step / 2 for limit in (2.2, 2.2, 0.7)]
centers = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
inside = scene.winding_number(centers) > 0.5
print(f"{inside.sum()} voxels, volume {inside.sum() * step**3:.3f} (the torus has {2 * np.pi**2 * 1.5 * 0.36:.3f})")

places = np.tile(np.eye(4), (inside.sum(), 1, 1))
places[:, :3, 3] = centers[inside]
half = step * 0.47
cube = lumbre.Box(p0=(-half, -half, -half), p1=(half, half, half), material=lumbre.Principled((0.9, 0.55, 0.15), roughness=0.4))
picture = lumbre.Scene(
    [lumbre.Instances(cube, places), lumbre.Plane(point=(0, 0, -0.7), material=lumbre.Diffuse(0.6))],
    camera=lumbre.Perspective((0, -6, 5), fov=36),
    lights=[lumbre.EnvironmentLight(0.8), lumbre.DistantLight((1, -1, 2), 2)],
)
picture.render(spp=16, size=(480, 300), denoise=True).save("voxels.png", tonemap="neutral")
