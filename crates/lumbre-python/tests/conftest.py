"""What the tests share."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import lumbre

ROOT = Path(__file__).resolve().parents[3]
SCENES = ROOT / "scenes"


def ball(levels: int = 3, radius: float = 2.5, center: tuple[float, float, float] = (0.5, -1.0, 3.0)) -> tuple[np.ndarray, np.ndarray]:
    """Vertices and faces of a closed mesh about a sphere, in double precision."""
    x = np.array([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]], dtype=float)
    f = np.array([[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4], [2, 0, 5], [1, 2, 5], [3, 1, 5], [0, 3, 5]])
    for _ in range(levels):
        a, b, c = x[f[:, 0]], x[f[:, 1]], x[f[:, 2]]
        middle = np.concatenate([a + b, b + c, c + a])
        middle /= np.linalg.norm(middle, axis=1, keepdims=True)
        n, m = len(x), len(f)
        ab, bc, ca = (n + k * m + np.arange(m) for k in range(3))
        x = np.concatenate([x, middle])
        f = np.concatenate(
            [
                np.stack([f[:, 0], ab, ca], axis=1),
                np.stack([ab, f[:, 1], bc], axis=1),
                np.stack([ca, bc, f[:, 2]], axis=1),
                np.stack([ab, bc, ca], axis=1),
            ]
        )
        x, where = np.unique(x.round(12), axis=0, return_inverse=True)
        f = where.reshape(-1)[f]
    return radius * x + np.array(center), f


def random_rays(count: int, seed: int = 7) -> tuple[np.ndarray, np.ndarray]:
    """Rays from around the ball, most of them towards it."""
    random = np.random.default_rng(seed)
    origins = random.normal(size=(count, 3)) * 6 + np.array([0.5, -1.0, 3.0])
    targets = random.normal(size=(count, 3)) * 2 + np.array([0.5, -1.0, 3.0])
    return origins, (targets - origins) * random.uniform(0.3, 3.0, size=(count, 1))


@pytest.fixture(scope="session")
def mixed() -> lumbre.Scene:
    """A mesh, exact shapes and instances."""
    vertices, faces = ball()
    places = np.tile(np.eye(4), (3, 1, 1))
    places[:, :3, 3] = [[6, 0, 3], [-6, 1, 3], [0.5, 7, 3]]
    return lumbre.Scene(
        [
            lumbre.Mesh(vertices, faces),
            lumbre.Torus(major=4.5, minor=0.4, center=(0.5, -1.0, 3.0)),
            lumbre.Instances(lumbre.Capsule(p0=(0, 0, -1), p1=(0, 0, 1), radius=0.7), places),
        ]
    )
