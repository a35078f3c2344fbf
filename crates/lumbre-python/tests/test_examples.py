"""The examples whose pictures are of rays alone run, and make them."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest
from conftest import ROOT

import lumbre

EXAMPLES = ROOT / "crates/lumbre-python/examples"


@pytest.mark.parametrize("name", ["sky_view", "thickness"])
def test_an_example_makes_its_picture(name: str, tmp_path) -> None:
    words = [sys.executable, str(EXAMPLES / f"{name}.py")]
    done = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True, env=dict(os.environ))
    assert done.returncode == 0, done.stderr
    picture = lumbre.read_image(tmp_path / f"{name}.png")
    assert picture.shape == (300, 480, 3) and 0.3 < picture.mean() < 0.97
    assert done.stdout.strip()
