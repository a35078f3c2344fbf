"""The viewer from Python: who may look, what they see, and that it ends."""

from __future__ import annotations

import http.client
import subprocess
import sys
from pathlib import Path
from urllib.parse import urlsplit

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


@pytest.fixture(params=["shapes", "file"])
def scene(request: pytest.FixtureRequest, tmp_path: Path) -> lumbre.Scene:
    vertices, faces = ball(2)
    if request.param == "shapes":
        return lumbre.Scene(lumbre.Mesh(vertices, faces))
    path = tmp_path / "ball.obj"
    lines = [f"v {x} {y} {z}" for x, y, z in vertices] + [f"f {a} {b} {c}" for a, b, c in faces + 1]
    path.write_text("\n".join(lines))
    return lumbre.load(path)


def test_the_page_is_there_and_gives_nothing_away(scene: lumbre.Scene) -> None:
    with scene.view(size=(40, 30), open=False) as viewer:
        address = urlsplit(viewer.url)
        # Browsers send nothing of what is behind the mark.
        assert address.hostname == "127.0.0.1" and address.path == "/" and len(address.fragment) == 64
        status, headers, page = ask(viewer, "/")
        assert status == 200 and b"<html" in page and headers["x-frame-options"] == "DENY"
        assert "set-cookie" not in headers and address.fragment.encode() not in page
        assert ask(viewer, "/", Host="example.org")[0] == 421
        # Pictures have addresses that are handed out to those who know the token.
        for path in ("/picture.png", "/ticket/0", f"/ticket/{address.fragment}", f"/{address.fragment}"):
            assert ask(viewer, path)[0] in (403, 404), path


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
