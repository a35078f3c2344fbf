"""A render on Dask workers of one thread, and on the same number of threads of one process, in turns: what machines cost where they are no gain.

    python many_machines_here.py [samples a pixel, by default 64] [rounds, by default 3] [workers, by default 2]

And what the formula and the simulation say. A machine of two cores that is idle is best.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable

import numpy as np
from many_machines import Costs, Job, Simulation, predict, spread
from many_machines_costs import ROOT, Farm

import lumbre
from lumbre import distributed as farm

SIZE = (960, 540)


def seconds(work: Callable[[], lumbre.Image]) -> tuple[float, np.ndarray]:
    began = time.perf_counter()
    picture = work()
    return time.perf_counter() - began, picture.array


def job_of(work: float, spp: int, slots: int) -> Job:
    """The render as `lumbre.distributed` cuts it."""
    plan = farm._Plan(1, (0, 0, *SIZE), spp, farm._wanted(slots), None, None, False)
    return Job(SIZE[0] * SIZE[1], work, len(plan.tiles), -(-spp // plan.step), spread())


def main(spp: int, rounds: int, slots: int) -> None:
    path = ROOT / "scenes/still-life/still-life.pbrt"
    scene, workers = lumbre.load(path), Farm(slots)
    ways: dict[str, Callable[[], lumbre.Image]] = {
        "threads": lambda: scene.render(spp, SIZE, threads=slots),
        "workers": lambda: farm.render(path, workers.client, spp, SIZE),
    }
    times: dict[str, list[float]] = {name: [] for name in ways}
    pictures = []
    try:
        # The scene is built before.
        farm.render(path, workers.client, 1, SIZE)
        for _ in range(rounds):
            for name, way in ways.items():
                before = workers.seconds()
                took, picture = seconds(way)
                client, scheduler, at_workers = workers.seconds() - before
                times[name].append(took)
                pictures.append(picture)
                spent = f"{client:.2f} s of the client's processor, {scheduler:.2f} s of the scheduler's, {at_workers:.2f} s of workers'"
                print(f"{slots} {name}: {took:.2f} s ({spent})", flush=True)
    finally:
        workers.close()
    assert all(np.array_equal(picture, pictures[0]) for picture in pictures), "pictures differ"
    threads, machines = min(times["threads"]), min(times["workers"])
    # Threads of one machine that are no gain to each other are no fault of workers.
    job, costs = job_of(threads * slots, spp, slots), Costs.measured()
    said, outcome = predict(job, costs, slots).seconds, Simulation(job, costs, slots).run()
    print(f"least of threads {threads:.2f} s, of workers {machines:.2f} s: efficiency {threads / machines:.1%}")
    print(f"{job.tasks} tasks; by the formula {said:.2f} s, by simulation {outcome.seconds * job.work / outcome.samples:.2f} s")


if __name__ == "__main__":
    given = [int(word) for word in sys.argv[1:]]
    main(*given, *(64, 3, 2)[len(given) :])
