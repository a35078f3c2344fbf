"""The viewer from Python: who may look, what they see, and that it ends."""

from __future__ import annotations

import http.client
import subprocess
import sys
import time
from pathlib import Path
from urllib.parse import urlsplit

import numpy as np
import pytest
from conftest import ball

import lumbre


def ask(viewer: lumbre.Viewer, path: str, **headers: str) -> tuple[int, dict[str, str], bytes]:
    connection = http.client.HTTPConnection(urlsplit(viewer.url).netloc, timeout=60)
    connection.request("GET", path, headers=headers)
    answer = connection.getresponse()
    try:
        return answer.status, dict(answer.getheaders()), answer.read()
    finally:
        connection.close()


def entered(viewer: lumbre.Viewer) -> str:
    """The cookie of who has opened the address."""
    status, headers, _ = ask(viewer, urlsplit(viewer.url).path)
    assert status == 303 and headers["location"] == "/"
    return headers["set-cookie"].split(";")[0]


@pytest.fixture(params=["shapes", "file"])
def scene(request: pytest.FixtureRequest, tmp_path: Path) -> lumbre.Scene:
    vertices, faces = ball(2)
    if request.param == "shapes":
        return lumbre.Scene(lumbre.Mesh(vertices, faces))
    path = tmp_path / "ball.obj"
    lines = [f"v {x} {y} {z}" for x, y, z in vertices] + [f"f {a} {b} {c}" for a, b, c in faces + 1]
    path.write_text("\n".join(lines))
    return lumbre.load(path)


def test_the_page_shows_the_picture_that_python_renders(scene: lumbre.Scene, tmp_path: Path) -> None:
    size = (40, 30)
    with scene.view(size=size, open=False) as viewer:
        cookie = entered(viewer)
        status, _, page = ask(viewer, "/", Cookie=cookie)
        assert status == 200 and b"<html" in page
        # The finest picture comes last.
        expected = tmp_path / "expected.png"
        scene.render(size=size).save(expected)
        found = tmp_path / "found.png"
        deadline = time.monotonic() + 120
        same = False
        while not same and time.monotonic() < deadline:
            status, _, picture = ask(viewer, "/picture.png", Cookie=cookie)
            if status == 200:
                found.write_bytes(picture)
                same = np.array_equal(lumbre.read_image(found), lumbre.read_image(expected))
            time.sleep(0.1)
        assert same


def test_none_but_who_has_the_address_may_look_and_it_works_once() -> None:
    with lumbre.Scene([lumbre.Sphere()]).view(size=(16, 12), open=False) as viewer:
        path = urlsplit(viewer.url).path
        assert urlsplit(viewer.url).hostname == "127.0.0.1"
        assert ask(viewer, "/")[0] == 403
        assert ask(viewer, path, Host="example.org")[0] == 421
        entered(viewer)
        assert ask(viewer, path)[0] == 403
        status, headers, _ = ask(viewer, "/")
        assert status == 403 and headers["x-frame-options"] == "DENY"


def test_it_is_closed_by_hand_when_forgotten_and_when_python_ends() -> None:
    scene = lumbre.Scene([lumbre.Sphere()])
    viewer = scene.view(size=(16, 12), open=False)
    address = urlsplit(viewer.url).netloc
    native = viewer._native
    viewer.close()
    viewer.close()
    assert not viewer.is_open and repr(viewer) == "<lumbre.Viewer, closed>" and "closed" in viewer._repr_html_()
    with pytest.raises(ConnectionRefusedError):
        http.client.HTTPConnection(address, timeout=10).connect()
    viewer = scene.view(size=(16, 12), open=False)
    native = viewer._native
    assert native.is_open() and viewer.url in viewer._repr_html_()
    del viewer
    assert not native.is_open()
    program = "import lumbre; viewer = lumbre.Scene([lumbre.Sphere()]).view(size=(640, 480), spp=100000, open=False); print(viewer.url)"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=120)
    assert done.returncode == 0 and done.stdout.startswith("http://127.0.0.1:") and not done.stderr
