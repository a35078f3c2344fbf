"""Line of sight between two sets of points: which observers see which targets, past the buildings of a block."""

import numpy as np

import lumbre

random = np.random.default_rng(3)
corners = np.stack(np.meshgrid(np.arange(6), np.arange(6)), -1).reshape(-1, 2) * 10.0
heights = random.uniform(4, 24, len(corners))
blocks = [lumbre.Box(p0=(x, y, 0), p1=(x + 6, y + 6, h), material=lumbre.Diffuse(0.7)) for (x, y), h in zip(corners, heights, strict=True)]
scene = lumbre.Scene([*blocks, lumbre.Plane(material=lumbre.Diffuse(0.4))])

observers = np.array([[28.0, -12.0, 12.0], [-9.0, 31.0, 20.0]])
targets = np.column_stack([random.uniform(-5, 65, (4000, 2)), np.full(4000, 0.1)])

# Every observer with every target: t is 1 at the target, which must not hide itself.
origins = np.repeat(observers, len(targets), axis=0)
directions = np.tile(targets, (len(observers), 1)) - origins
seen = ~scene.occluded(origins, directions, tmax=1 - 1e-9).reshape(len(observers), -1)
print(f"seen by the first {seen[0].mean():.0%}, by the second {seen[1].mean():.0%}, by both {seen.all(axis=0).mean():.0%}")

colours = np.array([[0.9, 0.2, 0.1], [0.1, 0.3, 0.9]])
dots = [
    lumbre.Sphere(center=t, radius=0.8, material=lumbre.Diffuse(0.05 + s @ colours * 0.9)) for t, s in zip(targets, seen.T, strict=True)
]
posts = [lumbre.Sphere(center=o, radius=2, material=lumbre.Diffuse(c)) for o, c in zip(observers, colours, strict=True)]
view = lumbre.Perspective((95, -75, 95), target=(28, 28, 0), fov=32)
picture = lumbre.Scene(
    [*blocks, *dots, *posts, lumbre.Plane()], camera=view, lights=[lumbre.EnvironmentLight(1.0), lumbre.DistantLight((1, -2, 3), 2)]
)
picture.render(spp=16, size=(480, 300), denoise=True).save("line_of_sight.png", tonemap="neutral")
