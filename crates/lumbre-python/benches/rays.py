"""Rays a second of Lumbre, embreex and Open3D on the same arrays, and how many of their hits are wrong.

    python rays.py [most rays a call, by default 1e6]

Peers that are not installed are left out. Each time is the least of several, taken in turns. Wrong hits are counted against exact
arithmetic: a hit is right if its triangle is met, and no other before it.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from fractions import Fraction

import numpy as np

import lumbre

Caster = Callable[[np.ndarray, np.ndarray], np.ndarray]


def ball(levels: int) -> tuple[np.ndarray, np.ndarray]:
    """A bumpy closed mesh of 8 * 4^levels triangles; float32 vertices."""
    x = np.array([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]], dtype=float)
    f = np.array([[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4], [2, 0, 5], [1, 2, 5], [3, 1, 5], [0, 3, 5]])
    for _ in range(levels):
        middle = np.concatenate([x[f[:, i]] + x[f[:, (i + 1) % 3]] for i in range(3)])
        middle /= np.linalg.norm(middle, axis=1, keepdims=True)
        ab, bc, ca = (len(x) + k * len(f) + np.arange(len(f)) for k in range(3))
        corners = [(f[:, 0], ab, ca), (ab, f[:, 1], bc), (ca, bc, f[:, 2]), (ab, bc, ca)]
        x, where = np.unique(np.concatenate([x, middle]).round(12), axis=0, return_inverse=True)
        f = where.reshape(-1)[np.concatenate([np.stack(c, axis=1) for c in corners])]
    x *= 1 + 0.05 * np.sin(9 * x[:, :1]) * np.cos(7 * x[:, 1:2])
    return x.astype(np.float32), f


def casters(vertices: np.ndarray, faces: np.ndarray) -> dict[str, Caster]:
    """The first triangle of each ray by each program, -1 for none."""
    scene = lumbre.Scene(lumbre.Mesh(vertices, faces))
    found: dict[str, Caster] = {"lumbre": lambda o, d: scene.cast(o, d, fields=("prim",)).prim}
    try:
        from embreex.mesh_construction import TriangleMesh
        from embreex.rtcore_scene import EmbreeScene

        embree = EmbreeScene()
        TriangleMesh(embree, vertices, faces.astype(np.int32))
        # It takes float32 alone.
        found["embreex"] = lambda o, d: embree.run(o.astype(np.float32, copy=False), d.astype(np.float32, copy=False))
    except ImportError:
        print("embreex is left out")
    try:
        import open3d as o3d

        o3d_scene = o3d.t.geometry.RaycastingScene()
        o3d_scene.add_triangles(o3d.core.Tensor(vertices), o3d.core.Tensor(faces.astype(np.uint32)))

        def open3d(o: np.ndarray, d: np.ndarray) -> np.ndarray:
            rays = o3d.core.Tensor(np.hstack([o, d]).astype(np.float32, copy=False))
            prim = o3d_scene.cast_rays(rays)["primitive_ids"].numpy()
            return np.where(prim == o3d_scene.INVALID_ID, -1, prim.astype(np.int64))

        found["open3d"] = open3d
    except (ImportError, OSError) as error:
        print(f"open3d is left out: {error}")
    return found


def rays(count: int) -> tuple[np.ndarray, np.ndarray]:
    """Rays from all around, unordered; most hit."""
    random = np.random.default_rng(1)
    origins = random.normal(size=(count, 3))
    origins *= 2.5 / np.linalg.norm(origins, axis=1, keepdims=True)
    return origins, random.normal(size=(count, 3)) * 0.6 - origins


def measure(most: int) -> None:
    vertices, faces = ball(7)
    programs = casters(vertices, faces)
    print(f"{len(faces)} triangles, {lumbre.thread_count()} threads; microseconds a call, and millions of rays a second")
    for dtype in (np.float32, np.float64):
        count = 1
        while count <= most:
            o, d = (array.astype(dtype) for array in rays(count))
            calls = max(1, 20_000 // count if count < 10 else 2_000 // count)
            best = dict.fromkeys(programs, np.inf)
            for _ in range(7 if count < 10**6 else 4):
                for name, cast in programs.items():
                    start = time.perf_counter()
                    for _ in range(calls):
                        cast(o, d)
                    best[name] = min(best[name], (time.perf_counter() - start) / calls)
            line = [f"{name} {1e6 * t:.2f} us {count / t / 1e6:.2f} M/s" for name, t in best.items()]
            against = f"; {best['embreex'] / best['lumbre']:.2f} x embreex" if "embreex" in best else ""
            print(f"{np.dtype(dtype).name} {count:>9} rays: {', '.join(line)}{against}", flush=True)
            count *= 10


def exact(o: list[Fraction], d: list[Fraction], corners: list[list[Fraction]]) -> tuple[Fraction, bool] | None:
    """Where a ray meets a triangle, its edges included, and whether its front, without any rounding."""

    def cross(a: list[Fraction], b: list[Fraction]) -> list[Fraction]:
        return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]

    def dot(a: list[Fraction], b: list[Fraction]) -> Fraction:
        return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]

    e, f, s = ([b - a for a, b in zip(p, q, strict=True)] for p, q in ((corners[0], corners[1]), (corners[0], corners[2]), (corners[0], o)))
    p = cross(d, f)
    determinant = dot(e, p)
    if determinant == 0:
        return None
    q = cross(s, e)
    u, v, t = dot(s, p) / determinant, dot(d, q) / determinant, dot(f, q) / determinant
    return (t, determinant > 0) if u >= 0 and v >= 0 and u + v <= 1 and t >= 0 else None


def count_wrong(count: int) -> None:
    """Rays at edges and vertices, where single precision errs."""
    vertices, faces = ball(3)
    random = np.random.default_rng(2)
    corners = vertices[faces].astype(float)
    weights = random.dirichlet([1, 1], count)
    at_vertex = random.random(count) < 0.3
    weights[at_vertex] = [1, 0]
    chosen = corners[random.integers(len(faces), size=count)]
    targets = weights[:, :1] * chosen[:, 0] + weights[:, 1:] * chosen[:, 1]
    origins = (random.normal(size=(count, 3)) * 4).astype(np.float32)
    directions = (targets - origins).astype(np.float32)
    # Candidates by double precision with a margin; what is near the edge of one is left to fractions.
    near: list[set[int]] = []
    for o, d in zip(origins.astype(float), directions.astype(float), strict=True):
        e, f, s = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0], o - corners[:, 0]
        p, q = np.cross(d, f), np.cross(s, e)
        with np.errstate(all="ignore"):
            determinant = np.einsum("ij,ij->i", e, p)
            u, v = np.einsum("ij,ij->i", s, p) / determinant, q @ d / determinant
        near.append(set(np.flatnonzero(~((u < -1e-6) | (v < -1e-6) | (u + v > 1 + 1e-6)))))
    answers = {name: cast(origins, directions) for name, cast in casters(vertices, faces).items()}
    wrong = {name: [0, 0] for name in answers}
    touching = 0
    for ray in range(count):
        o, d = ([Fraction(float(x)) for x in row] for row in (origins[ray], directions[ray]))
        found = {i: exact(o, d, [[Fraction(x) for x in corner] for corner in corners[i].tolist()]) for i in near[ray]}
        met = {i: hit for i, hit in found.items() if hit is not None}
        first = min((t for t, _ in met.values()), default=None)
        if len({front for t, front in met.values() if t == first}) > 1:
            # It touches the silhouette, and no more: whether that is a hit is for each program to say.
            touching += 1
            continue
        for name, answer in answers.items():
            prim = int(answer[ray])
            if prim < 0:
                wrong[name][0] += first is not None
            else:
                wrong[name][1] += first is None or prim not in met or met[prim][0] != first
    print(f"wrong of {count} rays at edges and vertices of {len(faces)} triangles, {touching} of which only touch")
    print("(lost, and of a triangle that is not the first):")
    print(", ".join(f"{name} {lost} and {other}" for name, (lost, other) in wrong.items()))


if __name__ == "__main__":
    count_wrong(20_000)
    measure(int(float(sys.argv[1])) if len(sys.argv) > 1 else 10**6)
