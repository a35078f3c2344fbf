"""Pictures and explanations are those of the program."""

from __future__ import annotations

import json
import pickle
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from conftest import SCENES, ball

import lumbre


def program(*words: object) -> str:
    done = subprocess.run([sys.executable, "-m", "lumbre", *map(str, words)], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.fixture
def model(tmp_path: Path) -> Path:
    """A model without camera and light: an .obj that stands a little off the origin."""
    vertices, faces = ball(2)
    lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in vertices.tolist()]
    lines += ["f " + " ".join(str(corner + 1) for corner in face) for face in faces.tolist()]
    path = tmp_path / "model.obj"
    path.write_text("\n".join(lines))
    return path


@pytest.mark.parametrize(
    "size, ending, words, options",
    [
        ((48, 30), "png", (), {}),
        ((20, 36), "pfm", (), {}),
        ((24, 18), "png", ("--spp", 3), {"spp": 3}),
        ((24, 18), "pfm", ("--integrator", "normals", "--spp", 1), {"integrator": "normals", "spp": 1}),
        ((24, 18), "exr", ("--denoise", "none", "--seed", 7), {"denoise": False, "seed": 7}),
        ((24, 18), "png", ("--background", "transparent", "--spp", 2), {"transparent": True, "spp": 2}),
    ],
    ids=["plain", "high", "spp", "normals", "noisy", "transparent"],
)
def test_a_model_by_itself_is_shown_as_the_program_shows_it(model: Path, tmp_path: Path, size, ending: str, words, options) -> None:
    scene = lumbre.load(model)
    # What was shown before does not matter.
    scene.render(spp=1, size=(9, 7))
    ours = scene.render(size=size, **options)
    expected, found = tmp_path / f"program.{ending}", tmp_path / f"package.{ending}"
    program("render", model, "--size", f"{size[0]}x{size[1]}", *words, "-q", "-o", expected)
    ours.save(found)
    np.testing.assert_array_equal(lumbre.read_image(found), lumbre.read_image(expected))
    if ending == "pfm":
        np.testing.assert_array_equal(ours.array, lumbre.read_image(expected))


def test_shapes_by_themselves_are_shown_as_their_file_is(model: Path) -> None:
    vertices, faces = ball(2)
    # An .obj is of single precision, and has y up.
    scene = lumbre.Scene(lumbre.Mesh(vertices.astype(np.float32), faces), up=(0, 1, 0))
    size = (40, 30)
    np.testing.assert_array_equal(scene.render(size=size).array, lumbre.load(model).render(size=size).array)
    assert scene.size == lumbre.load(model).size == (1200, 900)


def test_the_ground_of_a_picture_is_nothing_that_rays_meet(model: Path) -> None:
    scene = lumbre.load(model)
    down = [[0.5, 9.0, 3.0], [5.0, 9.0, 3.0]], [0.0, -1.0, 0.0]
    before = scene.count(*down)
    scene.render(spp=1, size=(8, 6))
    assert before.tolist() == scene.count(*down).tolist() == [2, 0]


def test_parts_of_a_picture_before_paper_are_put_together_before_it(model: Path) -> None:
    native = lumbre.load(model)._native
    options = {"size": (24, 18), "part": True}
    parts = [native.render({**options, "first_sample": first, "spp": 2}, None).take_part().to_bytes() for first in (0, 2)]
    whole = type(native.render({**options, "spp": 1}, None).take_part()).from_bytes(parts[0])
    whole.merge(parts[1])
    expected = lumbre.load(model).render(spp=4, size=(24, 18), denoise=False)
    np.testing.assert_array_equal(whole.picture().pixels(), expected.array)
    assert whole.picture().png(None, None) == expected.png()


@pytest.mark.parametrize("name", ["csg/csg.pbrt", "model"])
def test_an_explanation_is_that_of_the_program(model: Path, name: str) -> None:
    path = model if name == "model" else SCENES / name
    scene = lumbre.load(path)
    told = scene.explain((13, 11), size=(32, 24), sample=3, depth=1)
    words = ("explain", path, "--pixel", "13,11", "--size", "32x24", "--sample", 3, "--depth", 1, "-q")
    assert told == json.loads(program(*words, "--format", "json"))
    assert told.html() == program(*words, "--format", "html")
    assert told.text() == program(*words)
    assert told.markdown() == program(*words, "--format", "markdown")
    spanish = scene.explain((13, 11), size=(32, 24), sample=3, depth=1, lang="es")
    assert spanish == json.loads(program(*words, "--format", "json", "--lang", "es")) and spanish != told
    ray = ((-3.0, 1.5, 2.0), (2.0, -1.0, 0.5))
    words = ("explain", path, "--ray", "-3,1.5,2,2,-1,0.5,0.25,90", "--nearest", "-q", "--format", "json")
    assert scene.explain(ray=ray, tmin=0.25, tmax=90, nearest=True) == json.loads(program(*words))


def test_an_explanation_is_data_that_a_notebook_shows(model: Path) -> None:
    told = lumbre.Scene(lumbre.Box() - lumbre.Sphere(center=(0, 0, 0.5), radius=0.3)).explain(ray=((0, 0, 5), (0, 0, -1)))
    surfaces = next(section for section in told["sections"] if section["key"] == "surfaces")
    assert "sphere" in surfaces["sections"][0]["title"] and "csg" in surfaces["sections"][0]["title"]
    shown = told._repr_html_()
    assert shown.startswith("<iframe srcdoc=") and 'sandbox=""' in shown and "<script" not in shown
    copied = pickle.loads(pickle.dumps(told))
    assert copied == told and json.loads(json.dumps(told)) == told
    assert repr(told) == f"<lumbre.Explanation {told['title']!r}>"


@pytest.mark.parametrize(
    "asked, message",
    [
        ({}, "expected either a pixel or a ray"),
        ({"pixel": (1, 1), "ray": ((0, 0, 0), (0, 0, 1))}, "expected either a pixel or a ray"),
        ({"pixel": (8, 1), "size": (8, 6)}, r"outside of the picture \(expected less than \(8, 6\)\)"),
        ({"ray": ((0, 0, 0), (0, 0, 0))}, "invalid ray"),
        ({"ray": ((0, 0, np.nan), (0, 0, 1))}, "invalid ray"),
        ({"pixel": (1, 1), "lang": "fr"}, "language"),
        ({"pixel": (1, 1), "camera": "left"}, 'no camera "left"'),
    ],
)
def test_what_is_no_question_is_refused(asked, message: str) -> None:
    with pytest.raises(lumbre.LumbreError, match=message):
        lumbre.Scene([lumbre.Sphere()]).explain(**asked)
