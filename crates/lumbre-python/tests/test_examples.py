"""An example whose picture is of rays alone runs, and makes it; the cells of the notebook run."""

from __future__ import annotations

import json
import os
import subprocess
import sys

import pytest
from conftest import ROOT

import lumbre

EXAMPLES = ROOT / "crates/lumbre-python/examples"


@pytest.mark.parametrize("name", ["thickness"])
def test_an_example_makes_its_picture(name: str, tmp_path) -> None:
    words = [sys.executable, str(EXAMPLES / f"{name}.py")]
    done = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True, env=dict(os.environ))
    assert done.returncode == 0, done.stderr
    picture = lumbre.read_image(tmp_path / f"{name}.png")
    assert picture.shape == (300, 480, 3) and 0.3 < picture.mean() < 0.97
    assert done.stdout.strip()


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
