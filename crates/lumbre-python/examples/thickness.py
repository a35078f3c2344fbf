"""The thickness of a wall, by rays: from each point of the surface inwards to the other side, as a colour of its place."""

import numpy as np

import lumbre

# A bottle: a body with a hollow that is not in its middle.
wall = [
    lumbre.Capsule(p0=(0, 0, -1), p1=(0, 0, 1), radius=1.0),
    lumbre.Capsule(p0=(0.12, 0, -0.9), p1=(0, 0, 1.1), radius=0.8),
]
scene = lumbre.Scene(wall)

origins, directions = lumbre.Perspective((0, -7, 2), fov=36).rays(480, 300)
seen = scene.cast(origins.reshape(-1, 3), directions.reshape(-1, 3))
hit = seen.hit

# The next surface inwards along the normal; the start itself does not count.
inwards = scene.cast(seen.point[hit], -seen.normal[hit], tmin=1e-6, fields=("t",)).t
print(f"{hit.sum()} places, {inwards.min():.3f} to {inwards.max():.3f} thick")

share = np.clip((inwards - 0.1) / 0.25, 0, 1)[:, None]
light = (0.35 + 0.65 * np.clip(seen.normal[hit] @ np.array([0.5, -0.7, 0.5]), 0, 1))[:, None]
picture = np.ones((480 * 300, 3))
picture[hit] = light * (share * [0.1, 0.3, 0.9] + (1 - share) * [0.95, 0.15, 0.05])
lumbre.write_image("thickness.png", picture.reshape(300, 480, 3))
