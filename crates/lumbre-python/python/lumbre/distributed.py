"""Renders and ray queries on many machines, by Dask.

A render is cut into tasks, tiles by ranges of samples by frames, whose sums are merged as they come, exactly: the picture has the very
bytes of one machine, whatever order they come in, and whatever workers die, freeze or do a task twice.

Workers need this package, and, for a scene that is given by a path, the same path (shared storage) or `ship=True`.
"""

from __future__ import annotations

import hashlib
import io
import math
import os
import pickle
import queue
import tempfile
import threading
import time as clock
import zipfile
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from . import _lumbre
from ._arrays import rays
from ._lumbre import LumbreError
from .appearance import Camera
from .image import Image
from .scene import FIELDS, Hits, Progress, Scene, _checked, _columns, _options, load

# A render ends unevenly by about a task, and Dask takes some milliseconds for each: many for few threads, fewer for many.
_TASKS_PER_THREAD = (4, 32)
_MOST_TASKS = 1 << 14
_LEAST_SIDE = 16
# A task that is lost is no more than these, some ten seconds.
_MOST_SAMPLES = 1 << 23


def render(
    scene: Scene | str | os.PathLike[str],
    client: Any,
    spp: int | None = None,
    size: tuple[int, int] | None = None,
    *,
    frames: Sequence[float] | None = None,
    time: float | None = None,
    samples_per_task: int | None = None,
    tile: int | None = None,
    threads: int = 1,
    ship: bool = False,
    retries: int = 10,
    patience: float | None = None,
    progress: Progress | None = None,
    **options: Any,
) -> Any:
    """Renders on a Dask client.

    Parameters
    ----------
    scene : Scene or path
    client : distributed.Client
    spp, size, and others by name
        As of `Scene.render`, but for noise, min_spp and denoise, which need the whole picture.
    frames : times in seconds, optional
        Of a file; a list of pictures is returned then.
    time : seconds, optional
        Stops then, with the samples that every pixel has: the picture is that of one machine for that spp.
    samples_per_task, tile : optional
        How a render is cut: samples a pixel, and the side of square tiles. By default up to 32 tasks for each thread, 4 for those of
        thousands.
    threads : threads of each task
        1 where workers have a slot for each core, as is usual.
    ship : bool
        Sends the files of the scene along, once for each worker, by a hash of their contents.
    retries : how often a task is given out again whose worker died
    patience : seconds, optional
        After which a task is given to another worker as well; by default six times what such tasks took, and at least two seconds.
        Whichever is done first counts.
    progress : called as progress(samples, total, share)

    Raises what a task raises, and `LumbreError` where workers keep dying.
    """
    for name in ("noise", "min_spp", "denoise", "first_sample"):
        if options.pop(name, None):
            raise LumbreError(f"{name} is not for renders on many machines")
    sources = [_Source.of(scene, ship, frame) for frame in frames] if frames is not None else [_Source.of(scene, ship, None)]
    camera = options.get("camera")
    own = camera._size() if isinstance(camera, Camera) else None
    width, height = size or own or _known(sources[0]).size
    crop = options.pop("crop", None) or (0, 0, width, height)
    given = {name: value for name, value in options.items() if value is not None}
    given |= {"size": (width, height), "threads": threads}
    slots = max(1, sum(client.nthreads().values()))
    if spp is None:
        spp = 2**20 if time is not None else _known(sources[0])._native.samples()
    plan = _Plan(len(sources), crop, spp, _wanted(slots), tile, samples_per_task, time is not None)
    wholes: list[_lumbre.Part | None] = [None] * len(sources)
    runner = _Runner(client, retries, patience, 2 * slots + 2)
    scenes = [runner.share(source) for source in sources]

    def call(task: _Task) -> tuple[Callable[..., Any], tuple[Any, ...]]:
        return _render_part, (scenes[task.frame], sources[task.frame].key, given, task.crop, task.first, task.end)

    def take(task: _Task, part: bytes) -> None:
        whole = wholes[task.frame]
        if whole is None:
            wholes[task.frame] = _lumbre.Part.from_bytes(part)
        else:
            whole.merge(part)

    deadline = None if time is None else clock.monotonic() + time
    done, total = 0, plan.samples
    waiting: dict[int, list[tuple[_Task, bytes]]] = {}
    for task, part in runner.run(plan.tasks(), call, deadline):
        done += task.samples
        if deadline is None:
            take(task, part)
        else:
            # Only a pass that is whole counts, after all before it.
            waiting.setdefault(task.number, []).append((task, part))
        if progress is not None:
            if deadline is None or time is None:
                progress(done, total, done / total)
            else:
                progress(done, None, min(1.0, 1.0 - (deadline - clock.monotonic()) / time))
    for number in range(len(waiting)):
        parts = waiting.get(number, [])
        if len(parts) < plan.tasks_in_pass:
            break
        for task, part in parts:
            take(task, part)
    if any(whole is None for whole in wholes):
        raise LumbreError(f"time: {time} s passed before every pixel had a sample")
    images = [Image(whole.picture()) for whole in wholes if whole is not None]
    return images if frames is not None else images[0]


def cast(
    scene: Scene | str | os.PathLike[str],
    origins: npt.ArrayLike,
    directions: npt.ArrayLike,
    client: Any,
    tmin: npt.ArrayLike = 0.0,
    tmax: npt.ArrayLike = np.inf,
    *,
    fields: Sequence[str] = FIELDS,
    out: Mapping[str, npt.NDArray[Any]] | None = None,
    rays_per_task: int = 1 << 17,
    ship: bool = False,
    retries: int = 10,
    patience: float | None = None,
) -> Hits:
    """`Scene.cast` on a Dask client, with the same answers to the bit; arguments as there, and as of `render`.

    Memory-mapped rays are read, and a memory-mapped `out` is written, a few tasks at a time.
    """
    o, d, low, high = rays(origins, directions, tmin, tmax)
    source = _Source.of(scene, ship, None)
    slots = max(1, sum(client.nthreads().values()))
    runner = _Runner(client, retries, patience, 2 * slots + 2)
    shared = runner.share(source)
    columns = _columns(len(o), o.dtype, fields) if out is None else _checked(out)
    expected = _columns(0, o.dtype, tuple(columns))
    for name, column in columns.items():
        shape = (len(o), *expected[name].shape[1:])
        if column.shape != shape or column.dtype != expected[name].dtype:
            found = f"{column.dtype} of shape {column.shape}"
            raise LumbreError(f"out: {name} is of the wrong kind (found {found}; expected {expected[name].dtype} of shape {shape})")

    def some(limit: Any, part: slice) -> Any:
        return np.array(limit[part]) if isinstance(limit, np.ndarray) else limit

    def call(part: slice) -> tuple[Callable[..., Any], tuple[Any, ...]]:
        return _cast_part, (shared, source.key, some(o, part), some(d, part), some(low, part), some(high, part), tuple(columns))

    parts = (slice(first, min(first + rays_per_task, len(o))) for first in range(0, len(o), rays_per_task))
    for part, answers in runner.run(parts, call, None):
        for name, column in answers.items():
            columns[name][part] = column
    return Hits(columns)


@dataclass(frozen=True)
class _Source:
    """What workers make a scene of, by a hash of its contents."""

    key: str
    content: bytes

    @staticmethod
    def of(scene: Scene | str | os.PathLike[str], ship: bool, frame: float | None) -> _Source:
        if isinstance(scene, Scene):
            source = dict(scene._source)
        else:
            source = {"paths": (os.path.abspath(os.fspath(scene)),)}
        if frame is not None:
            if "paths" not in source:
                raise LumbreError("frames are for scenes of a file")
            source["frame"] = frame
        files = None
        if ship:
            if "paths" not in source:
                raise LumbreError("ship is for scenes of a file (others are sent anyway)")
            opened = scene if isinstance(scene, Scene) else load(scene)
            source["paths"], files = _pack(source["paths"], opened._native.files())
        content = pickle.dumps((source, files), protocol=4)
        return _Source(hashlib.sha256(content).hexdigest(), content)


def _pack(paths: tuple[str, ...], files: Iterable[str | Path]) -> tuple[tuple[str, ...], bytes]:
    """Files under their common folder, with the same relative names."""
    whole = sorted({os.path.abspath(name) for name in (*paths, *files) if os.path.isfile(name)})
    folder = os.path.commonpath([os.path.dirname(name) for name in whole])
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_STORED) as archive:
        for name in whole:
            # Without its time, so that the same contents are the same bytes.
            entry = zipfile.ZipInfo(os.path.relpath(name, folder))
            archive.writestr(entry, Path(name).read_bytes())
    return tuple(os.path.relpath(path, folder) for path in paths), packed.getvalue()


_scenes: dict[str, Scene] = {}
_building = threading.Lock()
_MOST_SCENES = 4


def _known(source: _Source) -> Scene:
    return _scene(source.content, source.key)


def _scene(content: bytes, key: str) -> Scene:
    """The scene of a source, built once in each process; a few are kept."""
    with _building:
        if key not in _scenes:
            while len(_scenes) >= _MOST_SCENES:
                del _scenes[next(iter(_scenes))]
            _scenes[key] = _made(content, key)
        return _scenes[key]


def _made(content: bytes, key: str) -> Scene:
    source, files = pickle.loads(content)
    if "shapes" in source:
        parts = source.pop("shapes")
        return Scene(parts, **source)
    paths = source.pop("paths")
    if files is None:
        return load(*paths, **source)
    with tempfile.TemporaryDirectory(prefix=f"lumbre-{key[:12]}-") as folder:
        with zipfile.ZipFile(io.BytesIO(files)) as archive:
            archive.extractall(folder)
        scene = load(*(os.path.join(folder, path) for path in paths), **source)
        # Its files go away; their hashes are what parts are known by.
        scene._native.hash_files()
        return scene


def _shared(content: bytes) -> bytes:
    return content


def _render_part(content: bytes, key: str, options: dict[str, Any], crop: tuple[int, int, int, int], first: int, end: int) -> bytes:
    native = _scene(content, key)._native
    given = {**options, "crop": crop, "first_sample": first, "spp": end - first, "part": True}
    return native.render(_options(given), None).take_part().to_bytes()


def _cast_part(content: bytes, key: str, o: Any, d: Any, low: Any, high: Any, fields: tuple[str, ...]) -> dict[str, Any]:
    hits = _scene(content, key).cast(o, d, low, high, fields=fields)
    return {name: getattr(hits, name) for name in hits.fields}


@dataclass(frozen=True)
class _Task:
    """Some samples of a tile of a frame."""

    frame: int
    number: int
    crop: tuple[int, int, int, int]
    first: int
    end: int

    @property
    def samples(self) -> int:
        x0, y0, x1, y1 = self.crop
        return (x1 - x0) * (y1 - y0) * (self.end - self.first)


def _wanted(slots: int) -> int:
    """Into about how many tasks a render is cut for so many threads."""
    least, most = _TASKS_PER_THREAD
    return max(least * slots, min(most * slots, _MOST_TASKS))


class _Plan:
    """How a render is cut: passes of some samples each, over tiles of all frames."""

    def __init__(
        self,
        frames: int,
        crop: tuple[int, int, int, int],
        spp: int,
        wanted: int,
        tile: int | None,
        samples: int | None,
        is_timed: bool,
    ) -> None:
        x0, y0, x1, y1 = crop
        if not (x0 < x1 and y0 < y1) or spp < 1:
            raise LumbreError(f"there is nothing to render (found crop {crop} and spp {spp})")
        pixels = (x1 - x0) * (y1 - y0)
        # A tile is sent once for every range of samples, so that the picture is rather cut into tiles.
        if not is_timed:
            wanted = max(wanted, math.ceil(pixels * spp * frames / _MOST_SAMPLES))
        side = tile or max(_LEAST_SIDE, math.ceil(math.sqrt(pixels * frames / wanted)))
        self.tiles = [(x, y, min(x + side, x1), min(y + side, y1)) for y in range(y0, y1, side) for x in range(x0, x1, side)]
        by_tasks = math.ceil(spp * len(self.tiles) * frames / wanted)
        by_size = max(1, _MOST_SAMPLES // min(pixels, side * side))
        self.step = samples or max(1, min(spp, by_tasks, by_size))
        if is_timed and samples is None:
            # Small at first, so that there is a picture soon.
            self.step = max(1, min(self.step, 4))
        self.frames, self.spp = frames, spp
        self.samples = pixels * spp * frames

    @property
    def tasks_in_pass(self) -> int:
        return self.frames * len(self.tiles)

    def tasks(self) -> Iterator[_Task]:
        for number, first in enumerate(range(0, self.spp, self.step)):
            for frame in range(self.frames):
                for crop in self.tiles:
                    yield _Task(frame, number, crop, first, min(first + self.step, self.spp))


@dataclass(eq=False)
class _Given:
    """A task that is given out, maybe several times."""

    task: Any
    started: float = 0.0
    futures: list[Any] = field(default_factory=list)
    failures: int = 0


class _Runner:
    """Gives tasks to workers, a window of them at a time, until each has been done once.

    What is done for a task takes the same time however many there are, and however many workers: all that is asked of the scheduler is
    asked for many tasks at once, and only tasks that are done are looked at.
    """

    POLL = 0.25
    LEAST_PATIENCE = 2.0
    # So many answers are fetched at once: few trips, and little memory.
    BATCH = 64
    # Times of enough tasks to estimate the usual one.
    REMEMBERED = 255

    def __init__(self, client: Any, retries: int, patience: float | None, window: int) -> None:
        self.client, self.retries, self.patience, self.window = client, retries, patience, window
        self.name = f"lumbre-{os.getpid()}-{clock.monotonic_ns()}"
        self.count = 0
        self.running: set[_Given] = set()
        self.givens: dict[str, _Given] = {}
        self.ended: queue.SimpleQueue[Any] = queue.SimpleQueue()
        self.late: list[Any] = []
        self.took: deque[float] = deque(maxlen=self.REMEMBERED)

    def share(self, source: _Source) -> Any:
        """The contents as the answer of a task, which Dask computes again where all workers that have it die."""
        return self.client.submit(_shared, source.content, key=f"lumbre-scene-{source.key}", pure=False)

    def run(
        self,
        tasks: Iterable[Any],
        call: Callable[[Any], tuple[Callable[..., Any], tuple[Any, ...]]],
        deadline: float | None,
    ) -> Iterator[tuple[Any, Any]]:
        """Each task with its answer, as they come; tasks that are not done at the deadline are cancelled."""
        rest = iter(tasks)
        looked = clock.monotonic()
        try:
            while True:
                while len(self.running) < self.window and (task := next(rest, None)) is not None:
                    given = _Given(task)
                    self.running.add(given)
                    self._give(given, call)
                if not self.running or (deadline is not None and clock.monotonic() > deadline):
                    return
                for future, answer in self._answers(self._ended(deadline), call):
                    # Another worker may have been sooner.
                    given_out = self.givens.get(future.key)
                    if given_out is not None:
                        self.took.append(clock.monotonic() - given_out.started)
                        self._call_off(given_out)
                        yield given_out.task, answer
                if clock.monotonic() - looked > self.POLL:
                    looked = clock.monotonic()
                    self._give_again(call)
                    late, self.late = self.late, []
                    for future in late:
                        self.ended.put(future)
        finally:
            for given in list(self.running):
                self._call_off(given)

    def _give(self, given: _Given, call: Callable[[Any], Any], others: list[str] | None = None) -> None:
        work, arguments = call(given.task)
        self.count += 1
        where = {"workers": others, "allow_other_workers": True} if others else {}
        key = f"{self.name}-{self.count}"
        given.started = clock.monotonic()
        self.givens[key] = given
        future = self.client.submit(work, *arguments, key=key, pure=False, priority=-self.count, **where)
        given.futures.append(future)
        future.add_done_callback(self.ended.put)

    def _give_again(self, call: Callable[[Any], Any]) -> None:
        """Gives tasks that take too long to workers as well that do not have them."""
        now, patience = clock.monotonic(), self._patience()
        slow = [given for given in self.running if now - given.started > patience and len(given.futures) < 4]
        if not slow:
            return
        try:
            names, processing = set(self.client.nthreads()), self.client.processing()
        except Exception:
            names, processing = set(), {}
        holder = {key: name for name, keys in processing.items() for key in keys}
        for given in slow:
            holders = {holder.get(future.key) for future in given.futures}
            self._give(given, call, sorted(names - holders) if holders & names else None)

    def _ended(self, deadline: float | None) -> list[Any]:
        """Futures that are done, after a while at most."""
        left = self.POLL if deadline is None else min(self.POLL, max(0.01, deadline - clock.monotonic()))
        ended: list[Any] = []
        try:
            ended.append(self.ended.get(timeout=left))
            while len(ended) < self.BATCH:
                ended.append(self.ended.get_nowait())
        except queue.Empty:
            pass
        ended = [future for future in ended if future.key in self.givens]
        # One whose answer was lost on the way is computed again by Dask.
        self.late += [future for future in ended if not future.done()]
        return [future for future in ended if future.done()]

    def _answers(self, futures: list[Any], call: Callable[[Any], Any]) -> Iterator[tuple[Any, Any]]:
        """The answers that have arrived; overdue tasks are submitted again."""
        if not futures:
            return
        try:
            answers = self._gathered(futures) if all(future.status == "finished" for future in futures) else None
        except Exception:
            # What was lost is looked at one by one.
            answers = None
        if answers is not None:
            yield from zip(futures, answers)
            return
        for future in futures:
            try:
                yield future, future.result(timeout=self._patience())
            except TimeoutError:
                self.late.append(future)
            except Exception as error:
                if not _is_of_workers(error):
                    raise
                self._lost(future, error, call)

    def _gathered(self, futures: list[Any]) -> list[Any]:
        async def gathered() -> Any:
            return await self.client.gather(futures, asynchronous=True)

        answers: list[Any] = self.client.sync(gathered, callback_timeout=self._patience())
        return answers

    def _lost(self, future: Any, error: Exception, call: Callable[[Any], Any]) -> None:
        given = self.givens.pop(future.key, None)
        if given is None:
            return
        given.futures.remove(future)
        given.failures += 1
        if given.failures > self.retries:
            raise LumbreError(f"a task was given out {given.failures} times, and lost each time: {error}") from error
        if not given.futures:
            self._give(given, call)

    def _patience(self) -> float:
        if self.patience is not None:
            return self.patience
        if len(self.took) < 3:
            # Nobody knows yet how long a scene takes to be built.
            return 60.0
        return max(self.LEAST_PATIENCE, 6 * sorted(self.took)[len(self.took) // 2])

    def _call_off(self, given: _Given) -> None:
        self.running.discard(given)
        for future in given.futures:
            self.givens.pop(future.key, None)
        unfinished = [future for future in given.futures if not future.done()]
        if unfinished:
            self.client.cancel(unfinished)
        given.futures.clear()


def _is_of_workers(error: BaseException) -> bool:
    """Whether a task failed for its workers, and not for what it is."""
    from asyncio import CancelledError
    from concurrent.futures import CancelledError as Cancelled

    from distributed.comm.core import CommClosedError
    from distributed.scheduler import KilledWorker

    return isinstance(error, (KilledWorker, CommClosedError, CancelledError, Cancelled))
