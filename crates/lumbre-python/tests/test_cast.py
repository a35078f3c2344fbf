"""Ray queries of arrays."""

from __future__ import annotations

import numpy as np
import pytest
from conftest import ball, random_rays

import lumbre
from lumbre.scene import FIELDS

# More than one piece of work, and not a whole number of them.
COUNT = 5_003


def assert_same(a: lumbre.Hits, b: lumbre.Hits) -> None:
    for name in FIELDS:
        np.testing.assert_array_equal(getattr(a, name), getattr(b, name), err_msg=name)


def by_loop(vertices: np.ndarray, faces: np.ndarray, origins: np.ndarray, directions: np.ndarray) -> np.ndarray:
    """The least t of each ray among triangles, without a tree."""
    a, b, c = (vertices[faces[:, corner]] for corner in range(3))
    e, f = b - a, c - a
    best = np.full(len(origins), np.inf)
    for ray, (o, d) in enumerate(zip(origins, directions)):
        p = np.cross(d, f)
        determinant = np.einsum("ij,ij->i", e, p)
        s = o - a
        u = np.einsum("ij,ij->i", s, p) / determinant
        q = np.cross(s, e)
        v = q @ d / determinant
        t = np.einsum("ij,ij->i", f, q) / determinant
        hit = (u >= 0) & (v >= 0) & (u + v <= 1) & (t >= 0)
        best[ray] = t[hit].min(initial=np.inf)
    return best


def test_a_mesh_is_hit_where_a_loop_over_its_triangles_says() -> None:
    vertices, faces = ball(2)
    origins, directions = random_rays(400)
    hits = lumbre.Scene([lumbre.Mesh(vertices, faces)]).cast(origins, directions)
    expected = by_loop(vertices, faces, origins, directions)
    assert 150 < hits.hit.sum() < 400
    np.testing.assert_array_equal(hits.hit, np.isfinite(expected))
    np.testing.assert_allclose(hits.t[hits.hit], expected[hits.hit], rtol=1e-13)
    points = origins + hits.t[:, None] * directions
    np.testing.assert_allclose(hits.point[hits.hit], points[hits.hit], atol=1e-12)


def test_an_exact_shape_is_hit_to_the_last_digits() -> None:
    origins, directions = random_rays(COUNT)
    center, radius = np.array([0.5, -1.0, 3.0]), 2.5
    hits = lumbre.Scene([lumbre.Sphere(center=center, radius=radius)]).cast(origins, directions)
    hit = hits.hit
    assert hit.sum() > 1500
    np.testing.assert_allclose(np.linalg.norm(hits.point[hit] - center, axis=1), radius, rtol=4e-16)
    outward = (hits.point[hit] - center) / radius
    np.testing.assert_allclose(hits.normal[hit], outward, atol=1e-15)
    np.testing.assert_array_equal(hits.front[hit], np.einsum("ij,ij->i", hits.normal, directions)[hit] < 0)
    assert np.isnan(hits.point[~hit]).all() and (hits.shape[~hit] == -1).all()


def test_many_rays_get_the_answers_of_each_alone(mixed: lumbre.Scene) -> None:
    origins, directions = random_rays(COUNT)
    together = mixed.cast(origins, directions)
    assert set(together.shape.tolist()) == {-1, 0, 1, 2} and set(together.instance.tolist()) == {-1, 0, 1, 2}
    for ray in range(0, COUNT, 97):
        alone = mixed.cast(origins[ray], directions[ray])
        for name in FIELDS:
            np.testing.assert_array_equal(getattr(alone, name)[0], getattr(together, name)[ray])


def test_strides_orders_and_read_only_arrays_change_nothing(mixed: lumbre.Scene) -> None:
    origins, directions = random_rays(COUNT)
    expected = mixed.cast(origins, directions)
    wide = np.full((2 * COUNT, 7), np.nan)
    wide[::2, 1:7:2] = origins
    backwards = np.ascontiguousarray(directions[::-1])[::-1]
    locked = directions.copy()
    locked.setflags(write=False)
    swapped = origins.astype(origins.dtype.newbyteorder())
    unaligned = np.zeros(COUNT * 24 + 1, dtype=np.uint8)[1:].view(np.float64).reshape(COUNT, 3)
    unaligned[:] = origins
    for o, d in [
        (wide[::2, 1:7:2], backwards),
        (np.asfortranarray(origins), locked),
        (swapped, np.asfortranarray(directions)),
        (unaligned, directions),
    ]:
        assert_same(mixed.cast(o, d), expected)
        np.testing.assert_array_equal(mixed.occluded(o, d), expected.hit)


def test_single_precision_is_the_answer_rounded(mixed: lumbre.Scene) -> None:
    origins, directions = (array.astype(np.float32) for array in random_rays(COUNT))
    single, double = mixed.cast(origins, directions), mixed.cast(origins.astype(float), directions.astype(float))
    assert single.t.dtype == single.normal.dtype == np.float32 and double.t.dtype == np.float64
    for name in FIELDS:
        expected = getattr(double, name)
        np.testing.assert_array_equal(getattr(single, name), expected.astype(getattr(single, name).dtype))
    assert mixed.cast(origins, directions.astype(float)).t.dtype == np.float64


def test_no_rays_have_no_answers(mixed: lumbre.Scene) -> None:
    for none in (np.zeros((0, 3)), np.zeros((0, 3), dtype=np.float32), []):
        hits = mixed.cast(none, none)
        assert len(hits) == 0 and hits.point.shape == (0, 3) and hits.uv.shape == (0, 2)
        assert mixed.occluded(none, none).shape == (0,) and mixed.cast_all(none, none).offsets.tolist() == [0]
        assert mixed.inside(none).shape == (0,) and len(mixed.closest_point(none)) == 0


def test_one_triple_is_for_all_rays() -> None:
    scene = lumbre.Scene([lumbre.Plane()])
    hits = scene.cast([[0.0, 0.0, 1.0], [5.0, 0.0, 2.0], [0.0, 7.0, 3.0]], [0.0, 0.0, -2.0])
    assert hits.t.tolist() == [0.5, 1.0, 1.5]
    assert scene.cast([0.0, 0.0, 4.0], [[0.0, 0.0, -1.0], [0.0, 0.0, 1.0]]).t.tolist() == [4.0, np.inf]


def test_ranges_are_kept_for_all_and_for_each(mixed: lumbre.Scene) -> None:
    origins, directions = random_rays(COUNT)
    free = mixed.cast(origins, directions)
    hit = free.hit
    assert not mixed.occluded(origins[hit], directions[hit], tmax=free.t[hit] * (1 - 1e-9)).any()
    assert mixed.occluded(origins[hit], directions[hit], tmax=free.t[hit]).all()
    assert (mixed.cast(origins, directions, tmin=0.5).t >= 0.5).all()
    further = mixed.cast(origins[hit], directions[hit], tmin=np.nextafter(free.t[hit], np.inf))
    assert (further.t > free.t[hit]).all() and further.hit.any()
    assert mixed.cast(origins[:3], directions[:3], tmax=np.float32(0)).hit.sum() == 0


def test_every_hit_is_listed_in_order(mixed: lumbre.Scene) -> None:
    origins, directions = random_rays(COUNT)
    every, first = mixed.cast_all(origins, directions), mixed.cast(origins, directions)
    counts = np.diff(every.offsets)
    np.testing.assert_array_equal(counts, mixed.count(origins, directions))
    np.testing.assert_array_equal(counts > 0, first.hit)
    assert counts.max() >= 4
    starts = every.offsets[:-1][counts > 0]
    for name in FIELDS:
        np.testing.assert_array_equal(getattr(every, name)[starts], getattr(first, name)[first.hit])
    same_ray = np.diff(every.ray) == 0
    assert (np.diff(every.t)[same_ray] >= 0).all()
    # A ray from outside of closed bodies goes in as often as out.
    assert (counts[~mixed.inside(origins)] % 2 == 0).all()


def test_fields_are_those_asked_for_and_out_is_written_in_place(mixed: lumbre.Scene) -> None:
    origins, directions = random_rays(COUNT)
    all_fields = mixed.cast(origins, directions)
    few = mixed.cast(origins, directions, fields=("t", "prim"))
    assert few.fields == ("t", "prim")
    with pytest.raises(AttributeError):
        few.normal
    out = {"t": np.zeros(COUNT), "point": np.zeros((COUNT, 3)), "prim": np.zeros(COUNT, dtype=np.int32)}
    hits = mixed.cast(origins, directions, out=out)
    assert hits.t is out["t"]
    for name, array in out.items():
        np.testing.assert_array_equal(array, getattr(all_fields, name))


def test_mapped_files_stream(mixed: lumbre.Scene, tmp_path) -> None:
    origins, directions = random_rays(COUNT)
    np.save(tmp_path / "rays.npy", np.concatenate([origins, directions], axis=1))
    rays = np.load(tmp_path / "rays.npy", mmap_mode="r")
    t = np.lib.format.open_memmap(tmp_path / "t.npy", mode="w+", dtype=np.float64, shape=(COUNT,))
    mixed.cast(rays[:, :3], rays[:, 3:], out={"t": t})
    t.flush()
    np.testing.assert_array_equal(np.load(tmp_path / "t.npy"), mixed.cast(origins, directions).t)


def test_vertices_in_double_precision_keep_it() -> None:
    # Near a planet's radius single precision knows half metres.
    height = 6.4e6 + 0.123456789
    vertices = np.array([[-1.0, -1.0, height], [2.0, -1.0, height], [-1.0, 2.0, height]])
    ray = ([0.1, 0.2, height + 3.0], [0.0, 0.0, -1.0])
    precise = lumbre.Scene([lumbre.Mesh(vertices, [[0, 1, 2]])]).cast(*ray)
    assert precise.point[0, 2] == height and precise.normal[0].tolist() == [0, 0, 1]
    single = lumbre.Scene([lumbre.Mesh(vertices, [[0, 1, 2]], precision="single")]).cast(*ray)
    assert 1e-3 < abs(single.point[0, 2] - height) < 0.5


def test_meshes_are_placed_in_double_precision() -> None:
    vertices, faces = ball(2)
    far = np.eye(4)
    far[:3, :3] = [[0, -2, 0], [2, 0, 0], [0, 0, 2]]
    far[:3, 3] = [1e6, -3e5, 0.25]
    origins, directions = random_rays(500)
    here = lumbre.Scene([lumbre.Mesh(vertices, faces)]).cast(origins, directions)
    moved = vertices @ far[:3, :3].T + far[:3, 3]
    o, d = origins @ far[:3, :3].T + far[:3, 3], directions @ far[:3, :3].T
    there = lumbre.Scene([lumbre.Mesh(vertices, faces, transform=far)]).cast(o, d)
    assert there.hit.sum() > 150
    np.testing.assert_array_equal(there.prim, here.prim)
    np.testing.assert_allclose(there.t[there.hit], here.t[here.hit], rtol=1e-8)
    np.testing.assert_array_equal(there.t, lumbre.Scene([lumbre.Mesh(moved, faces)]).cast(o, d).t)


def test_points_are_near_inside_and_wound_around() -> None:
    vertices, faces = ball(3)
    scene = lumbre.Scene([lumbre.Mesh(vertices, faces)])
    center, radius = np.array([0.5, -1.0, 3.0]), 2.5
    points = center + np.random.default_rng(3).normal(size=(1500, 3)) * 2
    distance = np.linalg.norm(points - center, axis=1) - radius
    clear = abs(distance) > 0.05
    inside = distance < 0
    assert 300 < inside.sum() < 1200
    np.testing.assert_array_equal(scene.inside(points)[clear], inside[clear])
    np.testing.assert_allclose(scene.winding_number(points)[clear], inside[clear], atol=0.02)
    np.testing.assert_allclose(scene.signed_distance(points), distance, atol=0.05)
    nearest = scene.closest_point(points)
    np.testing.assert_allclose(np.linalg.norm(nearest.point - points, axis=1), nearest.distance, rtol=1e-12)
    assert scene.closest_point(points, max_distance=0.1).distance[abs(distance) > 0.2].min() == np.inf


def test_a_mesh_that_is_inside_out_has_the_same_signed_distances() -> None:
    vertices, faces = ball(3)
    points = np.array([0.5, -1.0, 3.0]) + np.random.default_rng(5).normal(size=(500, 3)) * 2
    here = lumbre.Scene([lumbre.Mesh(vertices, faces)])
    flipped = lumbre.Scene([lumbre.Mesh(vertices, np.ascontiguousarray(np.asarray(faces)[:, ::-1]))])
    signed = flipped.signed_distance(points)
    assert 100 < (signed < 0).sum() < 400
    np.testing.assert_allclose(signed, here.signed_distance(points), rtol=1e-12)
    np.testing.assert_array_equal(signed < 0, flipped.inside(points))
    np.testing.assert_allclose(flipped.winding_number(points), -here.winding_number(points), atol=1e-12)


def test_what_has_no_answer_says_so() -> None:
    squeezed = lumbre.Torus(transform=np.diag([1.0, 2.0, 3.0, 1.0]))
    with pytest.warns(UserWarning, match="not known for 100 of 100 points: .*no nearest point"):
        nearest = lumbre.Scene([squeezed]).closest_point(np.full((100, 3), 0.1))
    assert np.isnan(nearest.distance).all() and (nearest.shape == -1).all()


@pytest.mark.parametrize(
    "origins, directions, limits, message",
    [
        (np.zeros((4, 2)), np.zeros((4, 3)), {}, r"origins has the wrong shape \(found \(4, 2\)"),
        (np.zeros((4, 3)), np.zeros((5, 3)), {}, "4 origins and 5 directions"),
        (np.zeros((4, 3, 1)), np.zeros((4, 3)), {}, "origins has the wrong shape"),
        (np.zeros((4, 3), dtype=complex), np.zeros((4, 3)), {}, "found complex128; expected real numbers"),
        (np.zeros((4, 3)), np.zeros((4, 3)), {"tmax": np.ones(3)}, r"tmax has the wrong length \(found 3; expected 4\)"),
        (np.zeros((4, 3)), np.zeros((4, 3)), {"fields": ("t", "depth")}, 'no field "depth"'),
        (np.zeros((4, 3)), np.zeros((4, 3)), {"out": {"t": np.zeros(3)}}, "out: t has the wrong length"),
        (np.zeros((4, 3)), np.zeros((4, 3)), {"out": {"t": np.zeros(4, dtype=np.float32)}}, "out: t"),
        (np.zeros((4, 3)), np.zeros((4, 3)), {"out": {"t": np.zeros(8)[::2]}}, "contiguous"),
        (np.zeros((4, 3)), np.zeros((4, 3)), {"out": {"t": [0.0] * 4}}, "out: t is no array"),
    ],
)
def test_wrong_arrays_are_refused(mixed, origins, directions, limits, message) -> None:
    with pytest.raises(lumbre.LumbreError, match=message):
        mixed.cast(origins, directions, **limits)


def test_odd_rays_miss(mixed: lumbre.Scene) -> None:
    odd = np.array([[np.nan, 0, 1], [0, 0, 0], [np.inf, 0, 0], [0, -0.0, 1e-320]])
    hits = mixed.cast(np.zeros((4, 3)), odd)
    assert not hits.hit[:2].any() and not np.isnan(hits.t).any()
    locked = np.zeros(4)
    locked.setflags(write=False)
    with pytest.raises(lumbre.LumbreError, match="read-only"):
        mixed.cast(np.zeros((4, 3)), odd, out={"t": locked})
