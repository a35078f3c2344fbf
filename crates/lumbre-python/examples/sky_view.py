"""Sky view factor and hours of sun of a mesh: how much of the sky each triangle sees, and how long the sun reaches it in a day."""

import numpy as np

import lumbre

# A landscape of hills, as a mesh.
x, y = np.meshgrid(np.linspace(-5, 5, 70), np.linspace(-5, 5, 70))
z = 1.3 * np.exp(-((x - 1) ** 2) - y**2) + 0.9 * np.exp(-((x + 2) ** 2) - (y + 1.5) ** 2) + 0.12 * np.sin(3 * x) * np.cos(2 * y)
vertices = np.stack([x, y, z], axis=-1).reshape(-1, 3).astype(np.float32)
a = (np.arange(69)[:, None] * 70 + np.arange(69)).reshape(-1)
faces = np.concatenate([np.stack([a, a + 1, a + 71], axis=1), np.stack([a, a + 71, a + 70], axis=1)])
land = lumbre.Scene(lumbre.Mesh(vertices, faces))

corners = vertices[faces].astype(np.float64)
normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
normals /= np.linalg.norm(normals, axis=1, keepdims=True)
starts = corners.mean(axis=1) + 1e-4 * normals

sky = np.random.default_rng(1).normal(size=(128, 3))
sky /= np.linalg.norm(sky, axis=1, keepdims=True)
sky[:, 2] = abs(sky[:, 2])
hours = np.linspace(-5.75, 5.75, 24)[:, None] * np.pi / 12
sun = np.hstack([-np.sin(hours), -0.6 * np.cos(hours), 0.8 * np.cos(hours)])


def light(directions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """For each direction and triangle, the cosine with which light comes, as it is and without shadows."""
    cosines = np.clip(directions @ normals.T, 0, None)
    return cosines * [~land.occluded(starts, d) for d in directions], cosines


seen, open_sky = light(sky)
view = seen.sum(axis=0) / open_sky.sum(axis=0)
daylight = (light(sun)[0] > 0).sum(axis=0) * 12 / len(sun)
print(f"sky view factor {view.min():.2f} to {view.max():.2f}; sun {daylight.min():.1f} to {daylight.max():.1f} hours")

level = np.stack([daylight, 0.8 * daylight, 3 + 0.4 * daylight], axis=1) / 12 * view[:, None]
image = lumbre.Perspective((0, -13, 9), fov=40).rays(480, 300)
hits = land.cast(image[0].reshape(-1, 3), image[1].reshape(-1, 3), fields=("prim",))
picture = np.where(hits.prim[:, None] >= 0, level[hits.prim], 1.0).reshape(300, 480, 3)
lumbre.write_image("sky_view.png", picture)
