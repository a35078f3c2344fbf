"""What else the process does: signals, threads, forks, and the program."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator

import numpy as np
import pytest
from conftest import random_rays

import lumbre


@pytest.fixture
def listens() -> Iterator[None]:
    """Who starts the tests in the background may have had Ctrl-C ignored."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


def test_ctrl_c_ends_a_cast_and_a_render_soon(mixed: lumbre.Scene, listens: None) -> None:
    origins, directions = random_rays(2000)
    # Enough rays for a minute or more, without memory.
    many = np.broadcast_to(origins[:1], (100_000_000, 3)), np.broadcast_to(directions[:1], (100_000_000, 3))
    out = np.empty(100_000_000, dtype=np.bool_)
    for work in (
        lambda: mixed.occluded(*many, out=out),
        lambda: mixed.render(spp=1_000_000, size=(64, 64)),
    ):
        pressed: list[float] = []

        def press() -> None:
            pressed.append(time.perf_counter())
            os.kill(os.getpid(), signal.SIGINT)

        timer = threading.Timer(0.4, press)
        timer.start()
        with pytest.raises(KeyboardInterrupt):
            work()
        # Not when the work would have ended: how soon it is, is for a machine that does nothing else.
        assert time.perf_counter() - pressed[0] < 30.0


def test_other_threads_run_meanwhile_and_may_ask_as_well(mixed: lumbre.Scene) -> None:
    origins, directions = random_rays(5003)
    expected = mixed.cast(origins, directions).t
    answers: list[np.ndarray] = []
    threads = [threading.Thread(target=lambda: answers.append(mixed.cast(origins, directions).t)) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(answers) == 4
    for answer in answers:
        np.testing.assert_array_equal(answer, expected)


@pytest.mark.skipif(not hasattr(os, "fork"), reason="there are no forks")
@pytest.mark.filterwarnings("ignore:.*fork.*:DeprecationWarning")
def test_a_fork_has_threads_of_its_own(mixed: lumbre.Scene) -> None:
    origins, directions = random_rays(5003)
    expected = mixed.cast(origins, directions).t
    picture = mixed.render(spp=1, size=(8, 6)).array
    child = os.fork()
    if child == 0:
        same = np.array_equal(mixed.cast(origins, directions).t, expected)
        same &= np.array_equal(mixed.render(spp=1, size=(8, 6)).array, picture)
        same &= lumbre.Scene([lumbre.Sphere()]).cast([0, 0, 3.0], [0, 0, -1.0]).t[0] == 2
        os._exit(0 if same else 1)
    deadline = time.monotonic() + 300
    while time.monotonic() < deadline:
        done, status = os.waitpid(child, os.WNOHANG)
        if done:
            assert status == 0
            return
        time.sleep(0.05)
    os.kill(child, signal.SIGKILL)
    os.waitpid(child, 0)
    pytest.fail("the fork waits for threads that it does not have")


def test_the_program_is_there_with_its_statuses(tmp_path) -> None:
    def run(*words: str) -> subprocess.CompletedProcess[str]:
        return subprocess.run([sys.executable, "-m", "lumbre", *words], capture_output=True, text=True)

    path = tmp_path / "model.obj"
    path.write_text("v 0 0 0\nv 2 0 0\nv 0 3 0\nf 1 2 3\n")
    done = run("info", str(path))
    assert done.returncode == 0 and "triangle" in done.stdout
    assert run("info", str(tmp_path / "nothing.obj")).returncode == 4
    wrong = run("rendr", str(path))
    assert wrong.returncode == 2 and "rendr" in wrong.stderr
    assert run("--version").stdout.startswith("lumbre ")


def test_a_panic_is_an_exception_and_the_threads_work_on(mixed: lumbre.Scene) -> None:
    origins, directions = random_rays(5003)
    expected = mixed.cast(origins, directions).t
    for _ in range(3):
        with pytest.raises(BaseException, match="on purpose") as raised:
            lumbre._lumbre.panic_on_purpose()
        assert raised.typename == "PanicException" and not isinstance(raised.value, Exception)
        np.testing.assert_array_equal(mixed.cast(origins, directions).t, expected)
