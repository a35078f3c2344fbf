"""Rays from a memory-mapped file, answers into others: rays a second, and the memory that it takes.

    python rays_of_files.py [rays, by default 1e8] [folder, by default one for temporary files]

A ray is 24 bytes in the file, its answers t and prim are 8.
"""

from __future__ import annotations

import sys
import tempfile
import threading
import time
from pathlib import Path

import numpy as np
from rays import ball
from rays import rays as some_rays

import lumbre

PIECE = 1_000_000


def write(path: Path, count: int) -> None:
    """The same million rays again and again, each time turned a little about the vertical."""
    origins, directions = some_rays(PIECE)
    file = np.lib.format.open_memmap(path, mode="w+", dtype=np.float32, shape=(count, 6))
    for first in range(0, count, PIECE):
        c, s = np.cos(1e-3 * first / PIECE), np.sin(1e-3 * first / PIECE)
        turn = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
        end = min(first + PIECE, count)
        file[first:end] = np.hstack([origins @ turn, directions @ turn])[: end - first]
    file.flush()


def memory() -> tuple[int, int]:
    """Bytes of this process that are its own, and those of files, which the system takes back when it needs them."""
    status = dict(line.split(":", 1) for line in Path("/proc/self/status").read_text().splitlines())
    return tuple(int(status[name].split()[0]) << 10 for name in ("RssAnon", "RssFile"))


class Watch(threading.Thread):
    """The most memory at any time."""

    def __init__(self) -> None:
        super().__init__(daemon=True)
        self.over, self.most = threading.Event(), memory()

    def run(self) -> None:
        while not self.over.wait(0.02):
            self.most = tuple(map(max, self.most, memory()))


def main(count: int, folder: Path) -> None:
    scene = lumbre.Scene(lumbre.Mesh(*ball(7)))
    write(folder / "rays.npy", count)
    rays = np.load(folder / "rays.npy", mmap_mode="r")
    kinds = {"t": np.float32, "prim": np.int32}
    out = {name: np.lib.format.open_memmap(folder / f"{name}.npy", mode="w+", dtype=kind, shape=(count,)) for name, kind in kinds.items()}
    # Threads and what a first query makes are there before.
    scene.cast(rays[:10_000, :3], rays[:10_000, 3:], fields=("t", "prim"))
    before, watch, began = memory(), Watch(), time.perf_counter()
    watch.start()
    scene.cast(rays[:, :3], rays[:, 3:], out=out)
    took = time.perf_counter() - began
    watch.over.set()
    watch.join()
    own, of_files = (most - least for most, least in zip(watch.most, before, strict=True))
    hit = sum(int(np.isfinite(out["t"][first : first + PIECE]).sum()) for first in range(0, count, PIECE))
    print(f"{count} rays, {rays.nbytes / 1e9:.1f} GB: {took:.1f} s, {count / took / 1e6:.2f} M rays/s, {hit / count:.1%} hit")
    print(f"memory of its own: {before[0] / 1e6:.1f} MB before, {own / 1e6:.1f} MB more at most")
    print(f"pages of files: {of_files / 1e6:.0f} MB more at most")


if __name__ == "__main__":
    count = int(float(sys.argv[1])) if len(sys.argv) > 1 else 10**8
    if len(sys.argv) > 2:
        main(count, Path(sys.argv[2]))
    else:
        with tempfile.TemporaryDirectory() as temporary:
            main(count, Path(temporary))
