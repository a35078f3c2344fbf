"""Memory: rays of files take none, what does not fit is refused, and what is shared is kept once."""

from __future__ import annotations

import os
import pickle
import subprocess
import sys
import threading
from pathlib import Path

import numpy as np
import pytest
from conftest import random_rays

import lumbre

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="the memory of a process is read as Linux reports it")


def own_memory() -> int:
    """Bytes of this process, without pages of files."""
    status = Path("/proc/self/status").read_text()
    return int(status.split("RssAnon:")[1].split()[0]) << 10


def test_rays_of_a_file_are_asked_for_in_constant_memory(mixed: lumbre.Scene, tmp_path: Path) -> None:
    # 96 MB of rays, and 24 MB of answers.
    count, kinds = 4_000_000, {"t": np.float32, "prim": np.int32}
    rays = np.lib.format.open_memmap(tmp_path / "rays.npy", mode="w+", dtype=np.float32, shape=(count, 6))
    origins, directions = random_rays(100_000)
    for first in range(0, count, 100_000):
        rays[first : first + 100_000] = np.hstack([origins, directions])
    out = {name: np.lib.format.open_memmap(tmp_path / name, mode="w+", dtype=kind, shape=(count,)) for name, kind in kinds.items()}
    expected = mixed.cast(rays[:100_000, :3], rays[:100_000, 3:], fields=("t", "prim"))
    most, over = own_memory(), threading.Event()
    before = most

    def watch() -> None:
        nonlocal most
        while not over.wait(0.002):
            most = max(most, own_memory())

    watcher = threading.Thread(target=watch)
    watcher.start()
    mixed.cast(rays[:, :3], rays[:, 3:], out=out)
    over.set()
    watcher.join()
    np.testing.assert_array_equal(out["t"].reshape(-1, 100_000), np.broadcast_to(expected.t, (40, 100_000)))
    np.testing.assert_array_equal(out["prim"][-100_000:], expected.prim)
    # Either the rays or the answers in memory would be more.
    assert most - before < 12 << 20, f"{(most - before) >> 20} MiB"


def limited(work: str, gigabytes: float = 1.5) -> str:
    """What Python code prints in a process with so much address space, after `import numpy as np, lumbre`."""
    limit = f"import resource, numpy as np, lumbre\nresource.setrlimit(resource.RLIMIT_AS, ({int(gigabytes * 2**30)},) * 2)\n"
    environment = {**os.environ, "OPENBLAS_NUM_THREADS": "1", "RAYON_NUM_THREADS": "2"}
    done = subprocess.run([sys.executable, "-c", limit + work], capture_output=True, text=True, env=environment, timeout=300)
    assert done.returncode == 0, f"{done.returncode}: {done.stderr}"
    return done.stdout


WALLS = "scene = lumbre.Scene([lumbre.Sphere(center=(0, 0, z), radius=0.4) for z in range(200)])\n"
MANY = "o = np.broadcast_to(np.array([0.0, 0.0, -2.0]), (count, 3)); d = np.broadcast_to(np.array([0.0, 0.0, 1.0]), (count, 3))\n"
REFUSED = "\ntry:\n    {}\nexcept MemoryError as error:\n    print('refused:', error)\nelse:\n    print('done')\n"


@pytest.mark.parametrize(
    "query",
    ["cast(o, d)", "cast(o, d, 0.1, fields=('t',))", "occluded(o, d)", "count(o, d)", "cast_all(o, d)", "closest_point(o)", "inside(o)"],
)
def test_answers_that_do_not_fit_raise_memory_error(query: str) -> None:
    count = 20_000_000_000
    answer = limited(f"count = {count}\n{WALLS}{MANY}{REFUSED.format(f'scene.{query}')}print(scene.count(o[:2], d[:2]))")
    assert answer.startswith("refused:") and "[400 400]" in answer, answer


def test_hits_that_do_not_fit_raise_memory_error_once_there_are_too_many() -> None:
    # 400 hits a ray: a few thousand fit, a million do not.
    work = f"count = 1_000_000\n{WALLS}{MANY}{REFUSED.format('scene.cast_all(o, d)')}print(len(scene.cast_all(o[:1000], d[:1000])))"
    answer = limited(work)
    assert answer.startswith("refused:") and "cast fewer rays at a time" in answer and "400000" in answer, answer


def test_pictures_that_do_not_fit_raise_memory_error() -> None:
    work = "scene = lumbre.Scene([lumbre.Sphere()])" + REFUSED.format("scene.render(1, (30000, 30000))")
    answer = limited(work + "print(scene.render(1, (40, 30)).shape)")
    assert answer.startswith("refused: a picture of 30000 by 30000 pixels: needs ") and "(30, 40, 3)" in answer, answer


def test_mixtures_of_mixtures_share_what_they_share() -> None:
    material: lumbre.Material = lumbre.Mix(lumbre.Diffuse(0.8), lumbre.Metal(0.9))
    before = own_memory()
    for _ in range(50):
        material = lumbre.Mix(material, material)
    scene = lumbre.Scene([lumbre.Sphere(material=material)])
    assert scene.render(1, (8, 6)).array.mean() > 0
    assert own_memory() - before < 64 << 20
    again = pickle.loads(pickle.dumps(material))
    assert isinstance(again, lumbre.Mix) and again.first is again.second
    with pytest.raises(lumbre.LumbreError, match="more than 64 deep"):
        for _ in range(50):
            material = lumbre.Mix(material, material)


def test_unions_in_loops_share_what_they_share() -> None:
    before = own_memory()
    body: lumbre.Shape = lumbre.Sphere()
    for i in range(400):
        body = body | lumbre.Sphere(center=(1.5 * i, 0, 0))
    assert own_memory() - before < 16 << 20
    assert int(lumbre.Scene(body).count([[-9.0, 0.0, 0.0]], [[1.0, 0.0, 0.0]])[0]) == 2
    with pytest.raises(lumbre.LumbreError, match=r"deep \(Union\(\*shapes\) makes one of many\)"):
        for _ in range(400):
            body = body | lumbre.Sphere()
    doubled: lumbre.Shape = lumbre.Sphere()
    with pytest.raises(lumbre.LumbreError, match="CSG of too many shapes"):
        for _ in range(40):
            doubled = doubled | doubled


def test_a_texture_on_many_materials_is_kept_once() -> None:
    texture = lumbre.Texture(np.zeros((1024, 1024, 3), dtype=np.uint8))
    before = own_memory()
    materials = [lumbre.Diffuse(texture) for _ in range(40)]
    assert own_memory() - before < 30 << 20 and len(materials) == 40
