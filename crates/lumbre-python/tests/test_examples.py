"""An example whose picture is of rays alone runs, and makes it; the cells of the notebook run."""

from __future__ import annotations

import contextlib
import json
import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from conftest import ROOT

import lumbre

EXAMPLES = ROOT / "crates/lumbre-python/examples"


@pytest.mark.parametrize("name", ["thickness", "sun_hours"])
def test_an_example_makes_its_picture(name: str, tmp_path) -> None:
    words = [sys.executable, str(EXAMPLES / f"{name}.py")]
    done = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True, env=dict(os.environ))
    assert done.returncode == 0, done.stderr
    picture = lumbre.read_image(tmp_path / f"{name}.png")
    assert picture.shape == (300, 480, 3) and 0.2 < picture.mean() < 0.97
    assert done.stdout.strip()


def made_small(name: str, folder: Path, *changes: tuple[str, str]) -> dict[str, object]:
    """The names of an example that ran in a folder, with less to render."""
    text = (EXAMPLES / f"{name}.py").read_text()
    for whole, small in changes:
        assert whole in text, whole
        text = text.replace(whole, small)
    names: dict[str, object] = {}
    with in_folder(folder):
        exec(text, names)
    return names


@contextlib.contextmanager
def in_folder(folder: Path) -> Iterator[None]:
    before = Path.cwd()
    os.chdir(folder)
    try:
        yield
    finally:
        os.chdir(before)


def test_a_data_set_of_views_is_made_of_one_tree(tmp_path) -> None:
    names = made_small("views", tmp_path, ("(160, 120), 8, 50", "(40, 30), 1, 50"))
    assert names["scene"]._native.trees() <= 2
    assert len(list((tmp_path / "views").glob("*.png"))) == 50
    data = json.loads((tmp_path / "transforms.json").read_text())
    assert data["w"] == 40 and len(data["frames"]) == 50
    assert 0.5 < names["seen"].mean() <= 1


def test_visibility_between_points_and_a_lidar_scan(tmp_path) -> None:
    small = ("spp=16, size=(480, 300), denoise=True", "spp=1, size=(48, 30)")
    names = made_small("line_of_sight", tmp_path, small, ("4000, 2", "400, 2"), ("np.full(4000", "np.full(400"))
    seen = names["seen"]
    assert seen.shape == (2, 400) and 0.05 < seen.mean() < 0.95
    small = ("spp=8, size=(480, 300)", "spp=1, size=(480, 300)")
    names = made_small("lidar", tmp_path, small, ("360, 0.2", "360, 4.0"), ("15, 64", "15, 8"))
    cloud = np.load(tmp_path / "lidar.npy")
    assert cloud.shape[1] == 3 and len(cloud) > 100 and np.isfinite(cloud).all()


def test_the_cells_of_the_notebook_run() -> None:
    notebook = json.loads((EXAMPLES / "tour.ipynb").read_text())
    cells = ["".join(cell["source"]) for cell in notebook["cells"] if cell["cell_type"] == "code"]
    small = [cell.replace("spp=16, size=(400, 260)", "spp=1, size=(40, 26)") for cell in cells]
    assert small != cells
    names: dict[str, object] = {}
    for cell in small:
        exec(cell, names)
    assert names["image"].array.shape == (26, 40, 3)
    assert set(names["hits"].shape.tolist()) == {0, 1, 2}
