"""The drop-in for trimesh: against its own intersector, and in its own tests if they are present."""

from __future__ import annotations

import copy
import os
import pickle
import sys
import types
from pathlib import Path

import numpy as np
import pytest
from conftest import random_rays

trimesh = pytest.importorskip("trimesh")

import lumbre.trimesh  # noqa: E402
from lumbre.trimesh import RayMeshIntersector  # noqa: E402

# The folder of tests in trimesh's source package, which its wheel does not have.
OWN_TESTS = Path(os.environ.get("TRIMESH_TESTS", "no folder"))


@pytest.fixture
def mesh() -> object:
    mesh = trimesh.creation.icosphere(subdivisions=2, radius=2.5)
    mesh.apply_translation([0.5, -1.0, 3.0])
    return mesh


def test_answers_are_those_of_trimesh(mesh) -> None:
    pytest.importorskip("rtree")
    origins, directions = random_rays(500)
    ours, own = RayMeshIntersector(mesh), trimesh.ray.ray_triangle.RayMeshIntersector(mesh)
    np.testing.assert_array_equal(ours.intersects_first(origins, directions), own.intersects_first(origins, directions))
    np.testing.assert_array_equal(ours.intersects_any(origins, directions), own.intersects_any(origins, directions))
    places, rays, triangles = ours.intersects_location(origins, directions)
    own_places, own_rays, own_triangles = own.intersects_location(origins, directions)
    order, own_order = np.lexsort((triangles, rays)), np.lexsort((own_triangles, own_rays))
    np.testing.assert_array_equal(rays[order], own_rays[own_order])
    np.testing.assert_array_equal(triangles[order], own_triangles[own_order])
    np.testing.assert_allclose(places[order], own_places[own_order], atol=1e-9)
    assert len(rays) > 300 and rays.dtype == triangles.dtype == np.int64
    first, first_rays = ours.intersects_id(origins, directions, multiple_hits=False)
    np.testing.assert_array_equal(first, ours.intersects_first(origins, directions)[first_rays])
    few, few_rays = ours.intersects_id(origins, directions, max_hits=1)
    np.testing.assert_array_equal(few_rays, first_rays)
    points = origins * 0.5
    np.testing.assert_array_equal(ours.contains_points(points), own.contains_points(points))


def test_a_changed_mesh_is_asked_as_it_is_now(mesh) -> None:
    intersector = RayMeshIntersector(mesh)
    ray = [[0.5, -1.0, 50.0]], [[0.0, 0.0, -1.0]]
    before = intersector.intersects_location(*ray)[0]
    assert intersector.scene is intersector.scene
    mesh.apply_translation([0, 0, 7])
    np.testing.assert_allclose(intersector.intersects_location(*ray)[0], before + [0, 0, 7])
    for again in (copy.deepcopy(intersector), pickle.loads(pickle.dumps(intersector))):
        np.testing.assert_array_equal(again.intersects_any(*ray), [True])
    with pytest.raises(ValueError, match="don't match"):
        intersector.intersects_any(np.zeros((2, 3)), np.zeros((3, 3)))


def test_open_meshes_contain_what_they_mostly_surround(mesh) -> None:
    mesh.update_faces(np.arange(len(mesh.faces)) % 40 != 7)
    assert not mesh.is_watertight
    intersector = RayMeshIntersector(mesh)
    points = np.array([[0.5, -1.0, 3.0], [0.5, 0.5, 3.0], [0.5, -1.0, 9.0]])
    assert intersector.contains_points(points).tolist() == [True, True, False]


def test_the_usual_switch_finds_it() -> None:
    before = type(trimesh.creation.box().ray)
    lumbre.trimesh.enable()
    try:
        lumbre.trimesh.enable()
        box = trimesh.creation.box()
        assert type(box.ray) is RayMeshIntersector
        assert type(trimesh.creation.box(use_embree=False).ray) is trimesh.ray.ray_triangle.RayMeshIntersector
        assert box.contains([[0.1, 0.2, 0.3], [2, 0, 0]]).tolist() == [True, False]
    finally:
        lumbre.trimesh.disable()
    assert type(trimesh.creation.box().ray) is before


LEFT_OUT = (
    # These read models that the source package leaves out.
    "test_rays",
    "test_contain_single",
    "test_on_edge",
    "test_issue_1362_many_rays_consistency",
    # Their rays touch the silhouette of a box and no more, which for us is outside on one side of each axis.
    "test_issue_2324_apply_scale_breaks_embree",
    "test_issue_2317_robust_edge_hits",
)


def own_tests() -> list[tuple[str, str]]:
    files = [path for path in (OWN_TESTS / "test_ray.py", OWN_TESTS / "test_ray_upstream.py") if path.exists()]
    lines = [(path.name, line) for path in files for line in path.read_text().splitlines()]
    names = [(file, line.split("(")[0][4:]) for file, line in lines if line.startswith("def test_")]
    return [(file, name) for file, name in names if name not in LEFT_OUT]


class Generic(types.ModuleType):
    """What trimesh's tests take from their helper, with meshes that are made where those of files are not there."""

    np, trimesh = np, trimesh
    import time

    class log:
        info = warning = staticmethod(lambda *what: None)

    @staticmethod
    def random(shape):
        return np.random.default_rng(0).random(shape)

    @staticmethod
    def get_mesh(name, **options):
        if name == "unit_cube.STL":
            return trimesh.creation.box(**options)
        assert name == "unit_sphere.STL"
        sphere = trimesh.creation.icosphere(subdivisions=3)
        return trimesh.Trimesh(sphere.vertices, sphere.faces, **options)


@pytest.mark.filterwarnings("ignore")
@pytest.mark.skipif(not OWN_TESTS.is_dir(), reason="trimesh's source package is not there")
@pytest.mark.parametrize("file, name", own_tests())
def test_its_own_tests_pass(file: str, name: str, monkeypatch) -> None:
    if name == "test_contains_cavity":
        pytest.importorskip("manifold3d")
    elif name in ("test_rps", "test_empty", "test_contains", "test_on_vertex", "test_multiple_hits", "test_box"):
        pytest.importorskip("rtree")
    monkeypatch.setitem(sys.modules, "generic", Generic("generic"))
    # Its tests of embree ask for a version.
    monkeypatch.setitem(sys.modules, "embreex", types.SimpleNamespace(__version__="4"))
    lumbre.trimesh.enable()
    try:
        module: dict[str, object] = {"__name__": "own"}
        code = (OWN_TESTS / file).read_text()
        if name == "test_on_vertex":
            # It is for trimesh's own rays alone, and ours pass as well.
            code = code.replace("for use_embree in [False]:", "for use_embree in [True]:")
        exec(compile(code, file, "exec"), module)
        module[name]()  # type: ignore[operator]
    finally:
        lumbre.trimesh.disable()
