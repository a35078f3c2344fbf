"""Scenes and pictures."""

from __future__ import annotations

import copy
import math
import pickle
import subprocess
import sys
from typing import Any

import numpy as np
import pytest
from conftest import SCENES, ball, random_rays

import lumbre
from lumbre.scene import FIELDS

OBJ = "v 0 0 0\nv 2 0 0\nv 0 3 0\nf 1 2 3\n"


def small_scene(**more: object) -> lumbre.Scene:
    vertices, faces = ball(1)
    return lumbre.Scene(
        [
            lumbre.Mesh(vertices, faces, material=lumbre.Diffuse((0.8, 0.3, 0.1))),
            lumbre.Plane(point=(0, 0, 0.25), material=lumbre.Principled(0.4, roughness=0.3)),
            lumbre.Sphere(center=(4, -2, 9), radius=1, emission=(40, 38, 30)),
        ],
        camera=lumbre.Perspective((0, -14, 6), target=(0.5, -1, 2.5), fov=35),
        lights=[lumbre.EnvironmentLight(0.3)],
        **more,
    )


def test_files_are_opened_and_their_errors_have_a_place(tmp_path) -> None:
    path = tmp_path / "model.obj"
    path.write_text(OBJ)
    scene = lumbre.load(path)
    assert scene.info["triangles"] == 1 and scene.bounds.tolist() == [[0, 0, 0], [2, 3, 0]]
    assert scene.cast([0.5, 0.5, 4.0], [0.0, 0.0, -2.0]).t.tolist() == [2.0]
    path.write_text(OBJ.replace("v 2 0 0", "v 2 zero 0"))
    with pytest.raises(lumbre.LumbreError, match=r"model.obj:2:5: .*found \"zero\""):
        lumbre.load(path)
    with pytest.raises(FileNotFoundError, match="nowhere.glb"):
        lumbre.load(tmp_path / "nowhere.glb")
    with pytest.raises(lumbre.LumbreError, match="exclude"):
        lumbre.load(path, lenient=True, strict=True)


def test_warnings_are_issued_and_kept(tmp_path) -> None:
    path = tmp_path / "scene.pbrt"
    path.write_text('WorldBegin\nShape "sphere" "float radius" 2 "float rdius" 3\n')
    with pytest.warns(UserWarning, match=r"scene.pbrt:2:"):
        scene = lumbre.load(path)
    assert len(scene.warnings) == 1 and "rdius" in scene.warnings[0]
    with pytest.raises(lumbre.LumbreError, match="rdius"):
        lumbre.load(path, strict=True)


@pytest.mark.parametrize(
    "make, message",
    [
        (lambda: lumbre.Sphere(radius=-1), "radius"),
        (lambda: lumbre.Torus(major=0), "majorradius"),
        (lambda: lumbre.Sphere(center=(0, 1)), "center is no triple"),
        (lambda: lumbre.Scene([lumbre.Sphere(transform=np.zeros((4, 4)))]), "transform"),
        (lambda: lumbre.Sphere(transform=np.eye(3)), "transform has the wrong shape"),
        (lambda: lumbre.Mesh(np.zeros((3, 3)), [[0, 1, 3]]), r"face 0 .*found 3; expected 0 to 2"),
        (lambda: lumbre.Mesh(np.zeros((3, 3)), [[0.0, 1.0, 2.0]]), "expected integers"),
        (lambda: lumbre.Mesh([[0, 0, 0], [1, np.nan, 0], [0, 1, 0]], [[0, 1, 2]]), "vertex 1 is not finite"),
        (lambda: lumbre.Mesh(np.full((4, 3), 0.1), [[0, 1, 2, 3]]), "quads"),
        (lambda: lumbre.Scene([lumbre.Mesh(np.eye(3), [[0, 1, 2]], normals=np.ones((2, 3)))]), "normals"),
        (lambda: lumbre.Scene(["sphere"]), "no shape"),
        (lambda: lumbre.Diffuse((0.5, -1, 0)), "reflectance"),
        (lambda: lumbre.Perspective((0, 0, 0), target=(0, 0, 0)), "does not see"),
        (lambda: lumbre.Perspective((0, -5, 0), fov=200), "fov"),
        (lambda: lumbre.DistantLight((0, 0, 0)), "towards"),
        (lambda: lumbre.EnvironmentLight(1.0, np.ones((3, 5, 3))), "twice as wide"),
    ],
)
def test_what_makes_no_scene_is_refused_where_it_stands(make, message) -> None:
    with pytest.raises(lumbre.LumbreError, match=message):
        make()


@pytest.mark.parametrize(
    "shape",
    [
        lumbre.Sphere(radius=1.5),
        lumbre.Disk(radius=2, inner_radius=0.5),
        lumbre.Box(p0=(-1, -2, -1), p1=(1, 2, 1.5)),
        lumbre.Cylinder(p0=(0, 0, -1), p1=(0, 1, 2), radius=0.8),
        lumbre.Cone(p0=(0, 0, -1), p1=(0, 0, 2), r0=1.5, r1=0.5),
        lumbre.Capsule(p0=(0, 0, -1), p1=(0, 0, 1), radius=0.8),
        lumbre.Torus(major=2, minor=0.7),
        lumbre.Paraboloid(radius=2, zmin=0, zmax=2),
        lumbre.Hyperboloid(p1=(1, 0, -2), p2=(0, 1.5, 2)),
        lumbre.Quadric(coefficients=(1, 2, 3, 0, 0, 0, 0, 0, 0, -4)),
        lumbre.Triangle(p0=(-3, -3, 0), p1=(3, -3, 0.5), p2=(0, 3, 0)),
        lumbre.Patch(p00=(-2, -2, 0), p10=(2, -2, 1), p01=(-2, 2, 0.5), p11=(2, 2, -1)),
    ],
    ids=lambda shape: type(shape).__name__,
)
def test_every_exact_shape_is_hit_and_survives_a_pickle(shape: lumbre.Shape) -> None:
    random = np.random.default_rng(5)
    origins = random.normal(size=(200, 3)) * 6
    directions = random.normal(size=(200, 3)) - origins
    hits = lumbre.Scene([shape]).cast(origins, directions)
    assert hits.hit.sum() > 20
    again = lumbre.Scene([pickle.loads(pickle.dumps(shape))]).cast(origins, directions)
    np.testing.assert_array_equal(again.t, hits.t)


def test_scenes_are_pickled_by_their_source(mixed: lumbre.Scene, tmp_path) -> None:
    origins, directions = random_rays(300)
    path = tmp_path / "model.obj"
    path.write_text(OBJ)
    for scene in (mixed, lumbre.load(path)):
        expected = scene.cast(origins, directions)
        for again in (pickle.loads(pickle.dumps(scene)), copy.deepcopy(scene)):
            for name in FIELDS:
                np.testing.assert_array_equal(getattr(again.cast(origins, directions), name), getattr(expected, name))
    assert len(pickle.dumps(lumbre.load(path))) < 500


def test_pictures_are_arrays_with_features(tmp_path) -> None:
    scene = small_scene()
    image = scene.render(spp=2, size=(24, 16), features=True)
    array = np.asarray(image)
    assert array.shape == (16, 24, 3) and array.dtype == np.float32 and array.mean() > 0.05
    depth, normal = image.feature("depth"), image.feature("normal")
    origins, directions = lumbre.Perspective((0, -14, 6), target=(0.5, -1, 2.5), fov=35).rays(24, 16)
    hits = scene.cast(origins.reshape(-1, 3), directions.reshape(-1, 3))
    forward = np.array([0.5, 13, -3.5]) / np.linalg.norm([0.5, 13, -3.5])
    along = ((hits.point - [0, -14, 6]) @ forward).reshape(16, 24)
    # Where the ground is near, its depth in a pixel is about that of the pixel's centre.
    flat = (hits.shape.reshape(16, 24) == 1) & (along < 25)
    assert flat.sum() > 20 and np.median(abs(depth - along)[flat] / along[flat]) < 0.05
    assert abs(np.linalg.norm(normal[flat], axis=-1) - 1).min() < 1e-3
    with pytest.raises(lumbre.LumbreError, match="features=True"):
        scene.render(spp=1, size=(8, 6)).feature("depth")
    image.save(tmp_path / "a.exr", layers=["depth"], precision="float")
    np.testing.assert_array_equal(lumbre.read_image(tmp_path / "a.exr"), array)
    image.save(tmp_path / "a.png", tonemap="agx", depth=16)
    assert lumbre.read_image(tmp_path / "a.png").shape == (16, 24, 3)
    with pytest.raises(OSError):
        image.save(tmp_path / "no" / "folder.png")
    with pytest.raises(lumbre.LumbreError, match='no tonemap "agix".*did you mean agx'):
        image.save(tmp_path / "a.png", tonemap="agix")


def test_a_picture_is_the_same_whatever_renders_it() -> None:
    scene = small_scene()
    expected = scene.render(spp=2, size=(20, 12), threads=1).array
    for again in (scene, pickle.loads(pickle.dumps(scene))):
        np.testing.assert_array_equal(again.render(spp=2, size=(20, 12), threads=3).array, expected)
    crop = scene.render(spp=2, size=(20, 12), crop=(3, 5, 11, 12)).array
    np.testing.assert_array_equal(crop, expected[5:12, 3:11])
    assert not np.array_equal(scene.render(spp=2, size=(20, 12), seed=5).array, expected)


def test_a_file_renders_as_the_program_renders_it(tmp_path) -> None:
    path = SCENES / "csg" / "csg.pbrt"
    ours = lumbre.load(path).render(spp=1, size=(16, 12))
    out = tmp_path / "program.pfm"
    words = [str(path), "--spp", "1", "--size", "16x12", "-q", "-o", str(out)]
    subprocess.run([sys.executable, "-m", "lumbre", "render", *words], check=True)
    np.testing.assert_array_equal(lumbre.read_image(out), ours.array)


def test_transparent_pictures_have_coverage() -> None:
    vertices, faces = ball(1)
    scene = lumbre.Scene([lumbre.Mesh(vertices, faces)])
    image = scene.render(spp=2, size=(16, 16), transparent=True)
    assert image.alpha is not None and image.alpha.shape == (16, 16)
    assert image.alpha[8, 8] == 1 and image.alpha[0, 0] == 0
    assert scene.render(spp=1, size=(4, 4)).alpha is None


def test_render_options_out_of_range_are_refused() -> None:
    scene = small_scene()
    for options, message in [
        ({"size": (0, 5)}, "0"),
        ({"camera": 3}, "no camera 3"),
        ({"camera": "left"}, 'no camera "left"'),
        ({"integrator": "pth"}, "did you mean path"),
        ({"time": -1.0}, "time"),
        ({"seed": -1}, "seed is out of range"),
        ({"max_depth": "deep"}, "max_depth is out of range .found 'deep'; expected a whole number"),
    ]:
        with pytest.raises(lumbre.LumbreError, match=message):
            scene.render(spp=1, **{"size": (4, 4), **options})


def test_progress_is_told_and_may_stop_a_render() -> None:
    told: list[tuple[int, int | None, float]] = []
    # So many samples that the time between two reports is over, on whatever machine, before it is done.
    limit = RuntimeError("told thrice")

    def listen(*state: Any) -> None:
        told.append(state)
        if len(told) == 3:
            raise limit

    with pytest.raises(RuntimeError, match="told thrice"):
        small_scene().render(spp=100_000, size=(32, 24), progress=listen)
    wanted = 100_000 * 32 * 24
    assert all(samples <= wanted and total == wanted and 0 <= share <= 1 for samples, total, share in told), told
    assert told[0][0] < told[1][0] < told[2][0], told

    def stop(samples: int, total: int | None, share: float) -> None:
        raise RuntimeError("enough")

    with pytest.raises(RuntimeError, match="enough"):
        small_scene().render(spp=100_000, size=(64, 48), progress=stop)


def test_notebooks_show_pictures_and_scenes() -> None:
    scene = small_scene()
    image = scene.render(spp=1, size=(8, 6))
    assert image._repr_png_()[:8] == b"\x89PNG\r\n\x1a\n"
    assert repr(image) == "<lumbre.Image 8 x 6, 1 samples a pixel>"
    assert "mesh" in repr(scene) and "sphere" in repr(scene)


@pytest.mark.parametrize(
    "options, expected",
    [
        ({"spp": 0}, r"spp is out of range \(found 0; expected a whole number from 1 to 4294967295\)"),
        ({"spp": 1.5}, "expected a whole number"),
        ({"spp": "4"}, "found '4'; expected a whole number"),
        ({"spp": True}, "found True; expected a whole number"),
        ({"noise": math.nan}, "noise is out of range .* expected a relative noise above 0"),
        ({"noise": 0}, "noise is out of range"),
        ({"noise": "0.1"}, "noise is out of range"),
        ({"time": -1}, r"time is out of range \(found -1; expected seconds, above 0\)"),
        ({"time": math.inf}, "time is out of range"),
        ({"size": "320x200"}, r"size is out of range \(found '320x200'; expected \(width, height\), 2 whole numbers\)"),
        ({"size": ("320", "200")}, "size is out of range .* expected a whole number from 1"),
        ({"size": (320,)}, "expected \\(width, height\\)"),
        ({"size": (0, 9)}, "size is out of range"),
        ({"size": 320}, "expected \\(width, height\\)"),
        ({"crop": (0, 0, 4)}, "expected \\(x0, y0, x1, y1\\)"),
        ({"seed": -1}, "seed is out of range"),
        ({"camera": 0.5}, "camera is out of range"),
        ({"integrator": 3}, "integrator is no name"),
        ({"transparent": "no"}, "transparent is neither True nor False"),
        ({"denoise": 1}, "denoise is neither True nor False"),
        ({"progress": 3}, "progress is no callable"),
    ],
)
def test_loose_options_are_answered_with_what_is_accepted(options: dict[str, Any], expected: str) -> None:
    with pytest.raises(lumbre.LumbreError, match=expected):
        lumbre.Scene([lumbre.Sphere()]).render(**options)


def test_numbers_of_numpy_are_options() -> None:
    scene = lumbre.Scene([lumbre.Sphere()])
    size, seed, transparent = np.array([8, 6]), np.uint64(3), np.bool_(True)
    with pytest.warns(UserWarning, match="the noise is not known yet, not below the target 0.5"):
        image = scene.render(np.int64(1), size, seed=seed, noise=np.float32(0.5), transparent=transparent)
    assert image.shape == (6, 8, 3)


def test_loose_arrays_are_answered_with_what_is_accepted() -> None:
    scene = lumbre.Scene([lumbre.Sphere()])
    o, d = np.array([[0.0, 0.0, -3.0], [0.0, 0.0, 3.0]]), np.array([0.0, 0.0, 1.0])
    masked = np.ma.masked_array(o, mask=[[False] * 3, [False, True, False]])
    for query in (scene.cast, scene.occluded, scene.count, scene.cast_all):
        with pytest.raises(lumbre.LumbreError, match="origins has masked values"):
            query(masked, d)
        with pytest.raises(lumbre.LumbreError, match="tmax has masked values"):
            query(o, d, tmax=masked[:, 1])
    for ask in (scene.closest_point, scene.inside, scene.winding_number, scene.signed_distance):
        with pytest.raises(lumbre.LumbreError, match="points has masked values"):
            ask(masked)
    assert scene.cast(np.ma.masked_array(o), d).t.tolist() == [2.0, np.inf]
    for out in (3, "t", [o]):
        with pytest.raises(lumbre.LumbreError, match="(?s)out has no arrays by name .* expected a dict of some of t, point"):
            scene.cast(o, d, out=out)
        with pytest.raises(lumbre.LumbreError, match="(?s)out is no array to write .* expected a numpy.ndarray"):
            scene.occluded(o, d, out=out)
    with pytest.raises(lumbre.LumbreError, match="fields are no names"):
        scene.cast(o, d, fields=3)
    with pytest.raises(lumbre.LumbreError, match='a hit has no field "3"'):
        scene.cast(o, d, fields=(3,))
    for distance in ("3", math.nan, -1.0, None):
        with pytest.raises(lumbre.LumbreError, match="max_distance is out of range"):
            scene.closest_point(o, distance)
    with pytest.raises(lumbre.LumbreError, match="vertices has masked values"):
        lumbre.Mesh(np.ma.masked_array(np.eye(3), mask=np.eye(3)), [[0, 1, 2]])
    with pytest.raises(lumbre.LumbreError, match="a texture has masked values"):
        lumbre.Texture(masked)
    image = np.full((4, 8, 3), 0.5)
    image[1, 6, 2] = np.nan
    with pytest.warns(UserWarning, match=r"texel \(6, 1\) of an environment is not finite, and taken for black"):
        sky = lumbre.EnvironmentLight(image=image)
    lit = lumbre.Scene([lumbre.Sphere()], lights=[sky]).render(1, (16, 12), denoise=False).array
    assert np.isfinite(lit).all() and lit.mean() > 0.1
    with pytest.raises(lumbre.LumbreError, match="pixel is out of range .* expected \\(x, y\\)"):
        scene.explain(("3", 4, 5))
    with pytest.raises(lumbre.LumbreError, match="size is out of range"):
        scene.view(size="9x9", open=False)
