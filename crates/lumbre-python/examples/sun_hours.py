"""Hours of sun on a roof: where the sun stands every ten minutes of a day, and which parts of the roof it reaches."""

import numpy as np

import lumbre

# A house with a roof to the south, a chimney, a dormer, and a taller house to the south-east; y is north, and z up.
roof = np.array([[-5.0, -4, 4], [5, -4, 4], [5, 0, 7], [-5, 0, 7]])
back = np.array([[5.0, 4, 4], [-5, 4, 4], [-5, 0, 7], [5, 0, 7]])
faces = np.array([[0, 1, 2], [0, 2, 3]])
scene = lumbre.Scene(
    [
        lumbre.Mesh(np.concatenate([roof, back]), np.concatenate([faces, faces + 4])),
        lumbre.Box(p0=(-5, -4, 0), p1=(5, 4, 4)),
        lumbre.Box(p0=(2.2, -1.6, 5), p1=(3.2, -0.8, 8)),
        lumbre.Box(p0=(-3, -3.2, 4), p1=(-1, -1, 6.4)),
        lumbre.Box(p0=(6, -22, 0), p1=(18, -13, 16)),
        lumbre.Plane(),
    ]
)

# Madrid, 21 December: the azimuth and the elevation of the sun at each time, in UTC.
step = 10
times = np.datetime64("2026-12-21T00:00") + np.arange(0, 24 * 60, step) * np.timedelta64(1, "m")
azimuth, elevation = lumbre.solar_position(times, latitude=40.42, longitude=-3.70)
a, e = np.radians(azimuth[elevation > 0]), np.radians(elevation[elevation > 0])
sun = np.stack([np.sin(a) * np.cos(e), np.cos(a) * np.cos(e), np.sin(e)], axis=1)

# Points of the roof, a little above it, in rows from the eaves to the ridge.
rows, columns = 60, 100
v, u = np.meshgrid((np.arange(rows) + 0.5) / rows, (np.arange(columns) + 0.5) / columns, indexing="ij")
places = roof[0] + u[..., None] * (roof[1] - roof[0]) + v[..., None] * (roof[3] - roof[0])
normal = np.cross(roof[1] - roof[0], roof[3] - roof[0])
normal /= np.linalg.norm(normal)
starts = (places + 1e-6 * normal).reshape(-1, 3)

# Every place with every direction: a ray that leaves without a hit reaches the sun.
hours = np.zeros(len(starts))
for towards in sun:
    hours += (towards @ normal > 0) & ~scene.occluded(starts, towards)
hours = hours.reshape(rows, columns) * step / 60
free = (sun @ normal > 0).sum() * step / 60
print(f"{hours.min():.1f} to {hours.max():.1f} hours of sun, {hours.mean():.1f} in the mean; {free:.1f} without shadows")

# From blue over red to yellow, the ridge at the top.
share = (hours[::-1] / free)[..., None]
colours = np.clip(np.concatenate([1.7 * share, 1.6 * share - 0.75, 0.45 - 0.4 * share], axis=-1), 0, 1)
lumbre.write_image("sun_hours.png", np.repeat(np.repeat(colours, 5, axis=0), 5, axis=1)[:, 10:490])
