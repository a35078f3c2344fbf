"""How long a render takes on 1 to 10,000 workers: a formula, and a simulation that it is compared with.

    python many_machines.py [folder of the plot, by default docs/measurements]

The costs are those of many_machines.json, which many_machines_costs.py measures. What the formula is made of is explained in
docs/measurements/distributed-scale.md.
"""

from __future__ import annotations

import bisect
import heapq
import itertools
import json
import math
import random
import sys
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import partial
from pathlib import Path

HERE = Path(__file__).resolve().parent


@dataclass(frozen=True)
class Costs:
    """What is spent besides samples: seconds for each task, byte or pixel, of one core."""

    client: float
    """At the client, a task: half to give it out, half to take note that it is done."""
    receive: float
    """At the client, a byte of an answer."""
    schedule: float
    """At the scheduler, a task from when it is given out until it is forgotten."""
    relay: float
    """At the scheduler, a byte of an answer on its way to the client."""
    start: float
    """At a worker, a task."""
    send: float
    """At a worker, a byte of an answer."""
    encode: float
    """At a worker, a pixel of a part as bytes."""
    merge_part: float
    """Where parts are merged, a part."""
    merge: float
    """Where parts are merged, a pixel."""
    part: float
    """Bytes of a part, a pixel."""
    latency: float
    """Of a message, besides what processes do for it."""
    ship: float
    """Seconds a byte of a scene from one process to the next."""

    @staticmethod
    def measured() -> Costs:
        """Those of many_machines.json."""
        known = json.loads((HERE / "many_machines.json").read_text())
        return Costs(**{part.name: known["costs"][part.name] for part in fields(Costs)})


def spread() -> list[float]:
    """How uneven tasks are, by many_machines.json."""
    times: list[float] = json.loads((HERE / "many_machines.json").read_text())["spread"]
    return times


@dataclass(frozen=True)
class Job:
    """A render, and how it is cut: each tile is rendered in passes, which are ranges of samples."""

    pixels: float
    work: float
    """Seconds of all samples on one thread."""
    tiles: int
    passes: int = 1
    spread: Sequence[float] = (1.0,)
    """Times of tasks as multiples of their mean, each as likely as the other."""
    build: float = 0.0
    """Seconds of a worker until it has built the scene."""
    scene: float = 0.0
    """Bytes of the scene that are sent to each worker."""
    threads: float = 1.0
    """Threads of each worker, all at one task."""
    fan_in: int = 1
    """How many passes of a tile workers merge before the client does."""

    @property
    def tasks(self) -> int:
        return self.tiles * self.passes

    @property
    def task(self) -> float:
        """The mean seconds of the samples of a task at a worker."""
        return self.work / self.tasks / self.threads

    @property
    def part_pixels(self) -> float:
        return self.pixels / self.tiles


@dataclass(frozen=True)
class Stages:
    """The mean seconds of a task in each place that it comes through, with its share of the merges at workers."""

    client: float
    scheduler: float
    worker: float

    @staticmethod
    def of(job: Job, costs: Costs) -> Stages:
        pixels, share = job.part_pixels, 1 / job.fan_in
        size = pixels * costs.part
        merge = costs.merge_part + costs.merge * pixels
        encode = costs.encode * pixels
        client = costs.client + share * (costs.receive * size + merge)
        scheduler = costs.schedule + share * costs.relay * size
        worker = job.task + costs.start + encode + share * costs.send * size
        if job.fan_in > 1:
            client += share * costs.client
            scheduler += share * costs.schedule
            worker += share * (costs.start + encode) + (costs.receive + costs.send) * size + merge
        return Stages(client, scheduler, worker)


@dataclass(frozen=True)
class Prediction:
    """What the formula says."""

    seconds: float
    efficiency: float
    limit: str
    """What keeps it from being faster: workers, client or scheduler."""


def predict(job: Job, costs: Costs, workers: int) -> Prediction:
    """The time of a render by the formula: the slowest place, and what comes before and after.

    The bounds of a closed network of queues: P. J. Denning and J. P. Buzen, "The operational analysis of queueing network models", ACM
    Computing Surveys 10 (3), 1978. We add the way to the first task and the uneven end.
    """
    stages, tasks = Stages.of(job, costs), job.tasks
    window = 2 * workers + 2
    cycle = stages.worker + stages.client + stages.scheduler + 4 * costs.latency
    # A worker has its first task after those before it have been given out; of many workers the one with the shortest is done first.
    wait = costs.client / 2 * min(workers, tasks) / 2
    shortest = stages.worker * min(job.spread)
    times = {
        "workers": max(wait + tasks * stages.worker / workers + tail(job, stages, workers), tasks * cycle / window),
        "client": shortest + tasks * stages.client,
        "scheduler": shortest + tasks * stages.scheduler,
    }
    limit = max(times, key=lambda place: times[place])
    seconds = start(job, costs, workers) + times[limit] + stages.client + stages.scheduler + 4 * costs.latency
    return Prediction(seconds, job.work / (workers * job.threads * seconds), limit)


def start(job: Job, costs: Costs, workers: int) -> float:
    """Seconds until workers have the scene: it doubles who has it in every step, from the client by the scheduler to the first."""
    steps = 2 + math.log2(workers) if job.scene > 0 else 0
    return job.build + steps * costs.ship * job.scene


def tail(job: Job, stages: Stages, workers: int) -> float:
    """Seconds from when workers have, on average, done their last tasks until the last of them has.

    When no task is left to give out, each worker has one that runs and one that waits. What is left of the first is distributed as the rest
    of a renewal process: density P(task > r) / mean. The longest of W sums of both is about the quantile 1 - 1 / (W + 1).
    """
    if workers == 1:
        return 0.0
    if job.tasks <= workers:
        longest = sorted(job.spread)[int(len(job.spread) * (1 - 1 / (job.tasks + 1)))]
        return stages.worker * (longest - job.tasks / workers)
    rest, steps = Rest(job.spread), 100
    rests = [rest.quantile((step + 0.5) / steps) for step in range(steps)]
    sums = sorted(left + time for left in rests for time in job.spread)
    mean = rest.mean + sum(job.spread) / len(job.spread)
    return stages.worker * (sums[int(len(sums) * (1 - 1 / (workers + 1)))] - mean)


class Rest:
    """What is left, at a random time, of times that follow one another."""

    def __init__(self, times: Sequence[float]) -> None:
        self.times = sorted(times)
        total = sum(self.times)
        self.mean = sum(time * time for time in self.times) / 2 / total
        # P(rest < x) at each time x; between them it is linear.
        self.shares, before, share = [0.0], 0.0, 0.0
        for number, time in enumerate(self.times):
            share += (time - before) * (len(self.times) - number) / total
            self.shares.append(share)
            before = time

    def quantile(self, share: float) -> float:
        at = min(bisect.bisect_left(self.shares, share), len(self.times))
        if at == 0:
            return 0.0
        low, high = ([0.0, *self.times][at - 1], self.times[at - 1])
        below, above = self.shares[at - 1], self.shares[at]
        return low + (high - low) * (share - below) / (above - below) if above > below else high


@dataclass(frozen=True)
class Accidents:
    """What goes wrong at workers."""

    deaths: float = 0.0
    """Deaths of a worker a second; what it had is given out again."""
    restart: float = 30.0
    """Seconds until another worker is there in its place."""
    slowness: float = 0.0
    """Speeds of workers are between 1 - slowness and 1 + slowness."""


@dataclass
class Outcome:
    """What a simulation came to."""

    seconds: float = 0.0
    merged: list[int] = field(default_factory=list)
    """How often each task is in the picture."""
    deaths: int = 0
    samples: float = 0.0
    """Seconds of samples that all tasks have together."""
    busy: dict[str, float] = field(default_factory=dict)
    """Seconds that client, scheduler and all workers were at work."""


class _Server:
    """One that does one thing after the other, in the order that they come."""

    def __init__(self, simulation: Simulation) -> None:
        self.simulation, self.free, self.busy = simulation, 0.0, 0.0

    def do(self, seconds: float, then: Callable[[], None]) -> None:
        self.free = max(self.free, self.simulation.now) + seconds
        self.busy += seconds
        self.simulation.at(self.free, then)


@dataclass
class _Worker:
    number: int
    speed: float
    ready: float
    queue: deque[_Work] = field(default_factory=deque)
    is_running: bool = False


@dataclass
class _Work:
    """A task, or the merge of some."""

    tasks: list[int]
    seconds: float


class Simulation:
    """A client, a scheduler and workers as `lumbre.distributed` has them, event by event.

    Two tasks for each worker are given out at a time; each goes to the worker with the fewest; an answer goes by the scheduler to the
    client, which merges it and gives out another task. The same seed gives the same outcome.
    """

    def __init__(self, job: Job, costs: Costs, workers: int, accidents: Accidents | None = None, seed: int = 1) -> None:
        if job.passes % job.fan_in != 0:
            raise ValueError(f"passes are no multiple of the fan-in (found {job.passes} and {job.fan_in})")
        if accidents is not None and accidents.deaths > 0 and job.fan_in > 1:
            raise ValueError("deaths are simulated without merges at workers alone, as nothing is lost there that is done")
        self.job, self.costs, self.accidents = job, costs, accidents or Accidents()
        self.random = random.Random(seed)
        self.now, self.count = 0.0, itertools.count()
        self.events: list[tuple[float, int, Callable[[], None]]] = []
        self.client, self.scheduler = _Server(self), _Server(self)
        speeds = [1 + self.accidents.slowness * (2 * self.random.random() - 1) for _ in range(workers)]
        ready = scene_arrivals(workers, costs.ship * job.scene)
        self.workers = [_Worker(n, speed, at + job.build) for n, (speed, at) in enumerate(zip(speeds, ready, strict=True))]
        self.shortest = [(0, n) for n in range(workers)]
        self.rest = iter(range(job.tasks))
        self.size = job.part_pixels * costs.part
        self.groups: dict[int, list[int]] = {}
        self.left = job.tasks
        self.outcome = Outcome(merged=[0] * job.tasks)
        self.working = 0.0

    def at(self, time: float, then: Callable[[], None]) -> None:
        heapq.heappush(self.events, (time, next(self.count), then))

    def run(self) -> Outcome:
        for task in itertools.islice(self.rest, 2 * len(self.workers) + 2):
            self.client.do(self.costs.client / 2, partial(self.give, task))
        while self.left > 0:
            self.now, _, then = heapq.heappop(self.events)
            then()
        self.outcome.seconds = self.now
        self.outcome.busy = {"client": self.client.busy, "scheduler": self.scheduler.busy, "workers": self.working}
        return self.outcome

    def give(self, task: int) -> None:
        """The client has given out a task."""
        samples = self.job.task * self.random.choice(self.job.spread)
        self.outcome.samples += samples * self.job.threads
        sent = self.costs.send * self.size if self.job.fan_in == 1 else 0.0
        self.hand_over(_Work([task], samples + self.costs.start + self.costs.encode * self.job.part_pixels + sent))

    def hand_over(self, work: _Work) -> None:
        self.at(self.now + self.costs.latency, partial(self.scheduler.do, self.costs.schedule / 2, partial(self.assign, work)))

    def assign(self, work: _Work) -> None:
        """The scheduler chooses the worker with the fewest tasks."""
        while True:
            length, number = heapq.heappop(self.shortest)
            worker = self.workers[number]
            # Older entries of a worker are not its length any more.
            if length == len(worker.queue):
                break
        worker.queue.append(work)
        heapq.heappush(self.shortest, (len(worker.queue), number))
        self.begin(worker)

    def begin(self, worker: _Worker) -> None:
        if worker.is_running or not worker.queue:
            return
        worker.is_running = True
        began = max(self.now + self.costs.latency, worker.ready)
        seconds = worker.queue[0].seconds / worker.speed
        death = self.random.expovariate(self.accidents.deaths) if self.accidents.deaths > 0 else math.inf
        self.working += min(death, seconds)
        if death < seconds:
            self.at(began + death, partial(self.die, worker))
        else:
            self.at(began + seconds, partial(self.end, worker))

    def die(self, worker: _Worker) -> None:
        self.outcome.deaths += 1
        lost, worker.queue = worker.queue, deque()
        worker.is_running, worker.ready = False, self.now + self.accidents.restart + self.job.build
        heapq.heappush(self.shortest, (0, worker.number))
        for work in lost:
            self.hand_over(work)

    def end(self, worker: _Worker) -> None:
        work = worker.queue.popleft()
        worker.is_running = False
        heapq.heappush(self.shortest, (len(worker.queue), worker.number))
        # A worker has its next task already.
        self.begin(worker)
        is_answer = len(work.tasks) == self.job.fan_in
        relayed = self.costs.relay * self.size if is_answer else 0.0
        hears = partial(self.take if is_answer else self.note, work)
        told = partial(self.scheduler.do, self.costs.schedule / 2 + relayed, lambda: self.at(self.now + self.costs.latency, hears))
        self.at(self.now + self.costs.latency, told)

    def take(self, work: _Work) -> None:
        """The client merges an answer."""
        merge = self.costs.merge_part + self.costs.merge * self.job.part_pixels
        self.client.do(self.costs.client / 2 + self.costs.receive * self.size + merge, partial(self.merged, work))
        if self.job.fan_in == 1:
            self.give_another()

    def merged(self, work: _Work) -> None:
        for task in work.tasks:
            self.outcome.merged[task] += 1
        self.left -= len(work.tasks)

    def note(self, work: _Work) -> None:
        """The client hears of a task whose answer stays at the worker, and has the passes of a tile merged when all are done."""
        self.client.do(self.costs.client / 2, lambda: None)
        self.give_another()
        (task,) = work.tasks
        group = self.groups.setdefault(task // self.job.fan_in, [])
        group.append(task)
        if len(group) == self.job.fan_in:
            pixels, sent = self.job.part_pixels, self.costs.send * self.size
            each = self.costs.receive * self.size + sent + self.costs.merge_part + self.costs.merge * pixels
            merge = _Work(group, self.costs.start + len(group) * each + self.costs.encode * pixels + sent)
            self.client.do(self.costs.client / 2, partial(self.hand_over, merge))

    def give_another(self) -> None:
        task = next(self.rest, None)
        if task is not None:
            self.client.do(self.costs.client / 2, partial(self.give, task))


def scene_arrivals(workers: int, seconds: float) -> list[float]:
    """When each worker has the scene: whoever has it sends it on, to one at a time; the first has it by way of the scheduler."""
    arrivals = [2 * seconds]
    holders = [2 * seconds]
    while len(arrivals) < workers:
        at = heapq.heappop(holders) + seconds
        arrivals.append(at)
        heapq.heappush(holders, at)
        heapq.heappush(holders, at)
    return arrivals


THREADS = [1, 2, 5, 10, 20, 50, 100, 200, 500, 1000, 2000, 5000, 10000]


SIZE = (7680, 4320)
SPP = 1024


def jobs() -> dict[str, Callable[[int], Job]]:
    """The renders of the plot, by their names, for so many threads: a large picture that takes one thread ten hours."""
    job = Job(pixels=SIZE[0] * SIZE[1], work=36000.0, tiles=2040, spread=spread(), build=0.5)
    few, many = replace(job, passes=2), replace(job, passes=16)
    return {
        "4080 tasks": lambda threads: few,
        "32640 tasks": lambda threads: many,
        "32640, merged by 16": lambda threads: replace(many, fan_in=16),
        "by default": lambda threads: default(job, threads),
        "2040, 32 threads a worker": lambda threads: replace(job, threads=32.0),
    }


def default(job: Job, slots: int) -> Job:
    """As `lumbre.distributed` cuts a render by default."""
    wanted = max(4 * slots, min(32 * slots, 1 << 14), math.ceil(job.pixels * SPP / (1 << 23)))
    side = max(16, math.ceil(math.sqrt(job.pixels / wanted)))
    tiles = math.ceil(SIZE[0] / side) * math.ceil(SIZE[1] / side)
    step = max(1, min(SPP, math.ceil(SPP * tiles / wanted), (1 << 23) // side**2))
    return replace(job, tiles=tiles, passes=math.ceil(SPP / step))


def table(costs: Costs) -> dict[str, list[tuple[int, Prediction, float]]]:
    """Threads, what the formula says, and the efficiency of a simulation, for each of the renders."""
    rows: dict[str, list[tuple[int, Prediction, float]]] = {}
    for name, job_of in jobs().items():
        for threads in THREADS:
            job = job_of(threads)
            workers = threads // round(job.threads)
            if workers == 0:
                continue
            outcome = Simulation(job, costs, workers).run()
            efficiency = outcome.samples / (workers * job.threads * outcome.seconds)
            rows.setdefault(name, []).append((round(workers * job.threads), predict(job, costs, workers), efficiency))
    return rows


# Distinct for most who see colours otherwise: Okabe and Ito, "Color universal design", 2008.
COLOURS = ["#d55e00", "#0072b2", "#009e73", "#cc79a7", "#333333"]


def plot(rows: dict[str, list[tuple[int, Prediction, float]]]) -> str:
    """Efficiency by threads: lines are the formula, dots are simulations."""
    left, right, top, bottom = 70.0, 520.0, 40.0, 410.0

    def x(threads: float) -> float:
        return left + (right - left) * math.log10(threads) / 4

    def y(efficiency: float) -> float:
        return bottom - (bottom - top) * efficiency

    out = [
        '<svg xmlns="http://www.w3.org/2000/svg" width="760" height="460" viewBox="0 0 760 460" font-family="sans-serif" font-size="13">',
        '<rect width="100%" height="100%" fill="white"/>',
        f'<text x="{left:.0f}" y="24" font-size="16">Many machines: lines are the formula, dots are simulated</text>',
    ]
    for power in range(5):
        for k in range(1, 10 if power < 4 else 2):
            at, stroke = x(k * 10**power), "#bbb" if k == 1 else "#eee"
            out.append(f'<path d="M{at:.1f} {top}V{bottom}" stroke="{stroke}"/>')
        out.append(f'<text x="{x(10**power):.1f}" y="{bottom + 18}" text-anchor="middle">{10**power}</text>')
    for percent in range(0, 101, 20):
        at = y(percent / 100)
        out.append(f'<path d="M{left} {at:.1f}H{right}" stroke="#bbb"/>')
        out.append(f'<text x="{left - 8}" y="{at + 4:.1f}" text-anchor="end">{percent} %</text>')
    for number, (name, points) in enumerate(rows.items()):
        colour = COLOURS[number]
        line = "L".join(f"{x(threads):.1f} {y(predicted.efficiency):.1f}" for threads, predicted, _ in points)
        out.append(f'<path d="M{line}" fill="none" stroke="{colour}" stroke-width="2"/>')
        for threads, _, simulated in points:
            out.append(f'<circle cx="{x(threads):.1f}" cy="{y(simulated):.1f}" r="4" fill="{colour}"/>')
        swatch = top + 8 + 22 * number
        out.append(f'<path d="M532 {swatch}h18" stroke="{colour}" stroke-width="4"/><text x="556" y="{swatch + 5}">{name}</text>')
    out.append(f'<text x="{(left + right) / 2}" y="{bottom + 38}" text-anchor="middle">threads of all workers</text>')
    middle = (top + bottom) / 2
    out.append(f'<text transform="translate(16 {middle}) rotate(-90)" text-anchor="middle">efficiency</text>')
    return "\n".join([*out, "</svg>", ""])


def main(folder: Path) -> None:
    rows = table(Costs.measured())
    print("| | threads | seconds | efficiency | simulated | limited by |\n|---|---|---|---|---|---|")
    for name, points in rows.items():
        for threads, predicted, simulated in points:
            numbers = f"{predicted.seconds:.1f} | {predicted.efficiency:.3f} | {simulated:.3f}"
            print(f"| {name} | {threads} | {numbers} | {predicted.limit} |")
    (folder / "distributed-scale.svg").write_text(plot(rows))


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "docs/measurements"))
