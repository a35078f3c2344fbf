"""Measures what a render on many machines costs besides samples, and writes many_machines.json.

    python many_machines_costs.py [scene, by default scenes/still-life/still-life.pbrt]

A scheduler and two workers are processes here. What they spend is seconds of their processors, so that other programs matter little.
"""

from __future__ import annotations

import json
import os
import platform
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterable
from pathlib import Path

import distributed
import numpy as np
import psutil
from many_machines import HERE

import lumbre
from lumbre import _lumbre
from lumbre import distributed as farm

ROOT = HERE.parents[2]
SIZE = (1920, 1080)


class Farm:
    """A scheduler and workers of one thread each, as processes of their own."""

    def __init__(self, workers: int) -> None:
        self.folder = tempfile.TemporaryDirectory()
        place = os.path.join(self.folder.name, "scheduler.json")
        quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
        command = [sys.executable, "-m"]
        scheduler = [*command, "distributed.cli.dask_scheduler", "--port", "0", "--no-dashboard", "--scheduler-file", place]
        worker = [*command, "distributed.cli.dask_worker", "--scheduler-file", place, "--no-nanny", "--nthreads", "1", "--no-dashboard"]
        self.scheduler = psutil.Popen(scheduler, **quiet)
        self.workers = [psutil.Popen([*worker, "--memory-limit", "0"], **quiet) for _ in range(workers)]
        while not os.path.exists(place):
            time.sleep(0.05)
        self.client = distributed.Client(scheduler_file=place)
        self.client.wait_for_workers(workers)

    def seconds(self) -> np.ndarray:
        """What client, scheduler and workers have spent so far."""

        def of(process: psutil.Process) -> float:
            times = process.cpu_times()
            return float(times.user + times.system)

        return np.array([of(psutil.Process()), of(self.scheduler), sum(of(worker) for worker in self.workers)])

    def close(self) -> None:
        self.client.close()
        for process in (*self.workers, self.scheduler):
            process.terminate()
            process.wait()
        self.folder.cleanup()

    def run(self, count: int, work: Callable[..., object], *arguments: object, window: int = 6) -> tuple[np.ndarray, float]:
        """What such tasks take, each: seconds spent by client, scheduler and workers, and seconds of the clock."""
        runner = farm._Runner(self.client, 0, 600.0, window)
        before, began = self.seconds(), time.perf_counter()
        done = sum(1 for _ in runner.run(range(count), lambda _: (work, arguments), None))
        took = time.perf_counter() - began
        assert done == count
        return (self.seconds() - before) / count, took / count


def line(xs: Iterable[float], ys: Iterable[float]) -> tuple[float, float]:
    """The value at 0 and the slope of the line through measured points, neither of them below 0."""
    x, y = np.array(list(xs)), np.array(list(ys))
    # By relative errors: large ones are not all that counts.
    (at_zero, slope), *_ = np.linalg.lstsq(np.stack([1 / y, x / y], axis=1), np.ones(len(y)), rcond=None)
    return max(0.0, float(at_zero)), max(0.0, float(slope))


def least(work: Callable[[], object], times: int = 7) -> float:
    """Seconds of the processor, of all threads, the least of several."""
    best = np.inf
    for _ in range(times):
        began = time.process_time()
        work()
        best = min(best, time.process_time() - began)
    return float(best)


def parts_of(scene: lumbre.Scene) -> dict[str, float]:
    """Parts as bytes, and merged into a whole picture."""
    pixels, encoding, merging, sizes = [], [], [], []
    whole = part_of(scene, (0, 0, *SIZE), 0)
    for sample, side in enumerate((16, 32, 64, 128, 256), start=1):
        # The numbers of more samples are wider.
        tile = part_of(scene, (320, 320, 320 + side, 320 + side), sample, 16)
        data = tile.to_bytes()
        pixels.append(side * side)
        sizes.append(len(data))
        encoding.append(least(tile.to_bytes))
        # Each goes into the picture once.
        again = [part_of(scene, (320, 320, 320 + side, 320 + side), 100 * sample + k).to_bytes() for k in range(7)]
        took = []
        for other in again:
            began = time.process_time()
            whole.merge(other)
            took.append(time.process_time() - began)
        merging.append(min(took))
    print("pixels", pixels, "bytes", sizes, "encoding", encoding, "merging", merging)
    merge_part, merge = line(pixels, merging)
    return {"encode": line(pixels, encoding)[1], "merge_part": merge_part, "merge": merge, "part": line(pixels, sizes)[1]}


def part_of(scene: lumbre.Scene, crop: tuple[int, int, int, int], sample: int, spp: int = 1) -> _lumbre.Part:
    options = {"size": SIZE, "crop": crop, "first_sample": sample, "spp": spp, "part": True, "threads": 1}
    return scene._native.render(options, None).take_part()


def spread_of(scene: lumbre.Scene, side: int = 120, spp: int = 4) -> list[float]:
    """Times of tiles as multiples of their mean."""
    times = []
    for y in range(0, SIZE[1], side):
        for x in range(0, SIZE[0], side):
            options = {"size": SIZE, "crop": (x, y, x + side, y + side), "spp": spp, "threads": 1}
            began = time.process_time()
            scene._native.render(options, None)
            times.append(time.process_time() - began)
    mean = sum(times) / len(times)
    return [round(t / mean, 3) for t in sorted(times)]


def costs_of_tasks(workers: Farm) -> dict[str, float]:
    """Tasks that do nothing, with answers of several sizes."""
    sizes = [0, 1 << 18, 1 << 20, 1 << 22]
    workers.run(200, bytes, 0)
    spent, clocks = [], []
    for size, count in zip(sizes, (2000, 400, 200, 100), strict=True):
        # Each worker has the answer already.
        answer = workers.client.scatter(os.urandom(size), broadcast=True)
        runs = [workers.run(count, farm._shared, answer) for _ in range(3)]
        spent.append(np.min([run[0] for run in runs], axis=0))
        clocks.append(min(run[1] for run in runs))
        print("answers of", size, "bytes: client, scheduler, workers", spent[-1], "clock", clocks[-1])
    (client, receive), (schedule, relay), (start, send) = (line(sizes, [s[place] for s in spent]) for place in range(3))
    alone = min(workers.run(200, bytes, 0, window=1)[1] for _ in range(3))
    latency = max(0.0, alone - client - schedule - start) / 4
    costs = {"client": client, "receive": receive, "schedule": schedule, "relay": relay}
    return costs | {"start": start, "send": send, "latency": latency}


def shipping(workers: Farm, size: int = 1 << 26) -> float:
    """Seconds a byte from the client by the scheduler and one worker to the other."""
    names = list(workers.client.nthreads())
    best = np.inf
    for _ in range(3):
        content = os.urandom(size)
        began = time.perf_counter()
        first = workers.client.submit(farm._shared, content, pure=False, workers=names[:1])
        distributed.wait(first)
        second = workers.client.submit(len, first, pure=False, workers=names[1:2])
        assert second.result() == size
        best = min(best, (time.perf_counter() - began) / 3 / size)
        first.release()
    return float(best)


def main(path: Path) -> None:
    scene = lumbre.load(path)
    costs = parts_of(scene)
    # A task of one sample, but for what Dask does.
    one = least(lambda: part_of(scene, (320, 320, 321, 321), 1), 50)
    workers = Farm(2)
    try:
        costs |= costs_of_tasks(workers)
        costs["start"] += one
        costs["ship"] = shipping(workers)
    finally:
        workers.close()
    rounded = {name: float(f"{value:.3g}") for name, value in costs.items()}
    versions = {"python": platform.python_version(), "distributed": distributed.__version__, "lumbre": lumbre.__version__}
    spread = spread_of(scene)
    (HERE / "many_machines.json").write_text(json.dumps({"costs": rounded, "spread": spread, "versions": versions}) + "\n")
    print(rounded, "spread", min(spread), max(spread))


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT / "scenes/still-life/still-life.pbrt")
