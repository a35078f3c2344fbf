"""Many machines: on a cluster of local processes, some of which die, freeze or are slow."""

from __future__ import annotations

import os
import random
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator

import numpy as np
import pytest
from conftest import SCENES, ball, random_rays

import lumbre
from lumbre.distributed import cast, render

distributed = pytest.importorskip("distributed")

pytestmark = pytest.mark.filterwarnings("ignore")
# Schedules of accidents; before a release 200.
SCHEDULES = 200 if os.environ.get("LUMBRE_LONG_TESTS") else 4


class Farm:
    """A scheduler here, and four workers, each a process of its own, as a batch system starts them."""

    def __init__(self) -> None:
        options = {"protocol": "tcp://", "dashboard_address": None, "silence_logs": 50}
        self.cluster = distributed.LocalCluster(n_workers=0, **options)
        self.client = distributed.Client(self.cluster)
        self.workers: list[subprocess.Popen[bytes]] = []

    def start_missing(self) -> None:
        self.workers = [worker for worker in self.workers if worker.poll() is None]
        words = [sys.executable, "-m", "distributed.cli.dask_worker", self.cluster.scheduler_address]
        words += ["--no-nanny", "--nthreads", "1", "--no-dashboard", "--memory-limit", "0", "--death-timeout", "300"]
        while len(self.workers) < 4:
            self.workers.append(subprocess.Popen(words, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL))

    def ready(self) -> distributed.Client:
        self.start_missing()
        self.client.wait_for_workers(4, timeout=300)
        return self.client

    def close(self) -> None:
        for worker in self.workers:
            worker.kill()
            worker.wait()
        self.client.close()
        self.cluster.close()


@pytest.fixture(scope="module")
def farm() -> Iterator[Farm]:
    farm = Farm()
    yield farm
    farm.close()


@pytest.fixture
def client(farm) -> distributed.Client:
    return farm.ready()


@pytest.fixture(scope="module")
def scene() -> lumbre.Scene:
    vertices, faces = ball(1)
    return lumbre.Scene(
        [lumbre.Mesh(vertices, faces), lumbre.Plane(point=(0, 0, 0.25), material=lumbre.Metal(0.8, 0.2))],
        camera=lumbre.Perspective((0, -14, 6), target=(0.5, -1, 2.5), fov=35),
        lights=[lumbre.EnvironmentLight(0.3), lumbre.DistantLight((1, -1, 2), 2)],
    )


def test_many_machines_render_the_bytes_of_one(client, scene) -> None:
    expected = scene.render(spp=5, size=(40, 30), features=True)
    told: list[float] = []
    image = render(scene, client, 5, (40, 30), features=True, tile=17, samples_per_task=2, progress=lambda *state: told.append(state[2]))
    np.testing.assert_array_equal(image.array, expected.array)
    np.testing.assert_array_equal(image.feature("normal"), expected.feature("normal"))
    assert image.png() == expected.png() and image.stats["rays"] == expected.stats["rays"]
    assert len(told) == 3 * 2 * 3 and told[-1] == 1.0
    crop = render(scene, client, 5, (40, 30), crop=(3, 4, 21, 29), threads=2)
    np.testing.assert_array_equal(crop.array, expected.array[4:29, 3:21])


def test_caustics_are_the_same_on_many_machines(client) -> None:
    path = SCENES.parent / "docs" / "pictures" / "integrator-caustics.pbrt"
    expected = lumbre.load(path).render(spp=9, size=(40, 25)).array
    np.testing.assert_array_equal(render(path, client, 9, (40, 25), tile=17, samples_per_task=2).array, expected)


def test_the_scheduler_is_asked_who_is_there_once_and_not_for_each_task(client, scene, monkeypatch) -> None:
    asked = {"nthreads": 0, "processing": 0}

    def counted(name):
        ask = getattr(client, name)

        def asks(*arguments, **named):
            asked[name] += 1
            return ask(*arguments, **named)

        return asks

    for name in asked:
        monkeypatch.setattr(client, name, counted(name))
    image = render(scene, client, 8, (40, 30), tile=5, samples_per_task=1, patience=60.0)
    np.testing.assert_array_equal(image.array, scene.render(spp=8, size=(40, 30)).array)
    # Not for each of the 384 tasks.
    assert asked == {"nthreads": 1, "processing": 0}


def test_files_are_read_from_shared_storage_or_sent_along(client, tmp_path) -> None:
    path = SCENES / "csg" / "csg.pbrt"
    expected = lumbre.load(path).render(spp=1, size=(16, 12)).array
    np.testing.assert_array_equal(render(path, client, 1, (16, 12)).array, expected)
    (tmp_path / "folder").mkdir()
    (tmp_path / "folder" / "ball.pbrt").write_text('Shape "sphere" "float radius" 2\n')
    sent = tmp_path / "scene.pbrt"
    sent.write_text('WorldBegin\nInclude "folder/ball.pbrt"\n')
    image = render(sent, client, 1, (8, 6), ship=True)
    np.testing.assert_array_equal(image.array, lumbre.load(sent).render(spp=1, size=(8, 6)).array)


def test_rays_come_back_with_the_answers_of_one(client, mixed) -> None:
    origins, directions = random_rays(5003)
    expected = mixed.cast(origins, directions, tmax=np.linspace(0.1, 2.0, 5003))
    hits = cast(mixed, origins, directions, client, tmax=np.linspace(0.1, 2.0, 5003), rays_per_task=700)
    for name in expected.fields:
        np.testing.assert_array_equal(getattr(hits, name), getattr(expected, name))


def test_rays_and_answers_may_be_files(client, mixed, tmp_path) -> None:
    origins, directions = random_rays(5003)
    expected = mixed.cast(origins, directions, fields=("t", "prim"))
    np.save(tmp_path / "rays.npy", np.hstack([origins, directions]))
    rays = np.load(tmp_path / "rays.npy", mmap_mode="r")
    kinds = {"t": np.float64, "prim": np.int32}
    out = {name: np.lib.format.open_memmap(tmp_path / name, mode="w+", dtype=kind, shape=(5003,)) for name, kind in kinds.items()}
    hits = cast(mixed, rays[:, :3], rays[:, 3:], client, out=out, rays_per_task=700)
    assert hits.fields == ("t", "prim")
    out["t"].flush()
    np.testing.assert_array_equal(np.load(tmp_path / "t"), expected.t)
    np.testing.assert_array_equal(out["prim"], expected.prim)
    for wrong in (np.zeros(5002), np.zeros(5003, dtype=np.float32), np.zeros((5003, 3))):
        with pytest.raises(lumbre.LumbreError, match="of the wrong kind"):
            cast(mixed, origins, directions, client, out={"t": wrong})


def test_a_time_limit_gives_what_one_machine_gives_for_as_many_samples(client, scene) -> None:
    for limit in (2.0, 8.0, 32.0, 128.0):
        try:
            image = render(scene, client, size=(24, 18), time=limit)
            break
        except lumbre.LumbreError as error:
            # A machine that is busy with other things has no picture so soon.
            assert "passed before" in str(error) and limit < 128.0
    spp = image.stats["spp"]
    assert 1 <= spp < 2**20
    np.testing.assert_array_equal(image.array, scene.render(spp=spp, size=(24, 18)).array)


def test_what_is_wrong_is_said_at_once(client, scene) -> None:
    with pytest.raises(lumbre.LumbreError, match="no camera 7"):
        render(scene, client, 1, (8, 6), camera=7)
    with pytest.raises(lumbre.LumbreError, match="denoise"):
        render(scene, client, 1, (8, 6), denoise=True)
    with pytest.raises(lumbre.LumbreError, match="nothing to render"):
        render(scene, client, 0, (8, 6))
    with pytest.raises(FileNotFoundError):
        render("nowhere.pbrt", client, 1, (8, 6))


HAPPENED: list[str] = []


class Accidents(threading.Thread):
    """Kills, freezes and wakes workers, as a seed says, until it is stopped. Killed ones are replaced."""

    def __init__(self, farm: Farm, seed: int) -> None:
        super().__init__(daemon=True)
        self.farm, self.random, self.over = farm, random.Random(seed), threading.Event()

    def run(self) -> None:
        frozen: list[subprocess.Popen[bytes]] = []
        kills = 0
        # A quick machine has a picture before chance would do anything.
        first = ["kill", "freeze"]
        while first or not self.over.wait(self.random.uniform(0.02, 0.4)):
            worker = self.random.choice(self.farm.workers)
            what = first.pop() if first else self.random.choice(["kill", "freeze", "wake"])
            if what == "kill" and kills < 3:
                kills += 1
                worker.kill()
                worker.wait()
                self.farm.start_missing()
            elif what == "freeze" and len(frozen) < 3:
                worker.send_signal(signal.SIGSTOP)
                frozen.append(worker)
            elif what == "wake" and frozen:
                frozen.pop(0).send_signal(signal.SIGCONT)
            else:
                continue
            HAPPENED.append(what)
        for worker in frozen:
            worker.send_signal(signal.SIGCONT)


@pytest.mark.parametrize("seed", range(SCHEDULES))
def test_workers_may_die_freeze_and_be_slow(farm, client, scene, seed) -> None:
    expected = scene.render(spp=8, size=(40, 30)).array
    accidents = Accidents(farm, seed)
    accidents.start()
    try:
        image = render(scene, client, 8, (40, 30), tile=10, samples_per_task=4, patience=1.0)
    finally:
        accidents.over.set()
        accidents.join()
    np.testing.assert_array_equal(image.array, expected)
    assert image.stats["samples"] == 8 * 40 * 30


def test_accidents_did_happen() -> None:
    assert HAPPENED.count("kill") >= 2 and HAPPENED.count("freeze") >= 2, HAPPENED
