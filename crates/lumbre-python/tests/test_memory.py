"""Rays of files take no memory, however many they are."""

from __future__ import annotations

import sys
import threading
from pathlib import Path

import numpy as np
import pytest
from conftest import random_rays

import lumbre

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="the memory of a process is read as Linux tells it")


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
