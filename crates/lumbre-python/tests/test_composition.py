"""Scenes put together, taken apart, and saved; shapes by expressions; media; names that people try."""

from __future__ import annotations

import contextlib
import io
import pydoc

import numpy as np
import pytest
import trimesh
from conftest import SCENES, ball, random_rays

import lumbre

OBJ = "v 0 0 0\nv 2 0 0\nv 0 3 0\nvt 0 0\nvt 1 0\nvt 0 1\nf 1/1 2/2 3/3\n"


@pytest.fixture
def triangle(tmp_path) -> lumbre.Scene:
    path = tmp_path / "model.obj"
    path.write_text(OBJ)
    return lumbre.load(path)


def test_loaded_scenes_stand_among_shapes(triangle: lumbre.Scene) -> None:
    scene = lumbre.Scene([lumbre.Sphere(center=(0, 0, -9)), triangle, lumbre.Box(), lumbre.Sphere(center=(9, 0, 0))])
    origins = np.array([[0.0, 0, -20], [0.5, 0.75, 20], [-0.3, -0.3, 20], [9, 0, 20]])
    directions = np.array([[0.0, 0, 1], [0, 0, -1], [0, 0, -1], [0, 0, -1]])
    assert scene.cast(origins, directions).shape.tolist() == [0, 1, 2, 3]
    assert scene.info["shapes"] == {"mesh": 1, "sphere": 2, "box": 1}
    # What is up is that of the file.
    assert lumbre.Scene([triangle])._native.size() == triangle._native.size()
    with pytest.raises(lumbre.LumbreError, match="no shape"):
        lumbre.Scene([triangle, "sphere"])
    import pickle

    again = pickle.loads(pickle.dumps(scene))
    np.testing.assert_array_equal(again.cast(origins, directions).t, scene.cast(origins, directions).t)


def test_cameras_and_lights_of_a_file_come_along() -> None:
    file = lumbre.load(SCENES / "csg" / "csg.pbrt")
    whole = lumbre.Scene([file])
    np.testing.assert_array_equal(whole.render(spp=1, size=(12, 9)).array, file.render(spp=1, size=(12, 9)).array)
    own = lumbre.Perspective((3, -7, 4))
    assert lumbre.Scene([file], camera=own).info["cameras"][0] == "perspective"


def test_meshes_are_arrays_in_the_world(triangle: lumbre.Scene) -> None:
    mesh = triangle.meshes[0]
    assert (mesh.shape, mesh.instance) == (0, -1) and mesh.normals is None
    np.testing.assert_array_equal(mesh.vertices, [[0, 0, 0], [2, 0, 0], [0, 3, 0]])
    np.testing.assert_array_equal(mesh.faces, [[0, 1, 2]])
    np.testing.assert_array_equal(mesh.uvs, [[0, 0], [1, 0], [0, 1]])
    vertices, faces = ball(1)
    mirror = lumbre.scale(-1, 1, 1) @ lumbre.translate(3, 0, 0)
    places = np.stack([lumbre.translate(0, 0, 20), lumbre.rotate("x", 90)])
    scene = lumbre.Scene(
        [
            lumbre.Sphere(center=(0, 0, -30)),
            lumbre.Mesh(vertices, faces, transform=mirror),
            lumbre.Instances(lumbre.Mesh(vertices, faces, normals=vertices - [0.5, -1.0, 3.0]), places),
        ]
    )
    found = scene.meshes
    assert [(mesh.shape, mesh.instance) for mesh in found] == [(1, -1), (2, 0), (2, 1)]
    for mesh in found:
        # Faces run counter-clockwise as seen from outside, also behind a mirror.
        corners = mesh.vertices[mesh.faces]
        volume = np.einsum("ni,ni->", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) / 6
        assert volume > 45
    np.testing.assert_allclose(np.linalg.norm(found[2].normals, axis=1), 1)
    # The triangle that a ray hits is that of `prim`.
    o, d = random_rays(300)
    o, d = (np.c_[o, np.ones(len(o))] @ places[0].T)[:, :3], d
    hits = scene.cast(o, d)
    on = (hits.instance == 0) & hits.hit
    assert on.sum() > 50
    corners = found[1].vertices[found[1].faces[hits.prim[on]]]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    np.testing.assert_allclose(normals, hits.normal[on], atol=1e-5)


def test_meshes_of_trimesh_are_taken_as_they_are() -> None:
    mesh = trimesh.creation.icosphere(subdivisions=2)
    o, d = random_rays(200)
    expected = lumbre.Scene(lumbre.Mesh(mesh.vertices, mesh.faces)).cast(o, d)
    for scene in (lumbre.Scene(mesh), lumbre.Scene([lumbre.Mesh(mesh)]), lumbre.Scene(lumbre.Mesh.from_trimesh(mesh))):
        np.testing.assert_array_equal(scene.cast(o, d).t, expected.t)
    mesh.visual.face_colors = [255, 0, 0, 255]
    view = lumbre.Perspective((0, -4, 0), fov=20)
    seen = lumbre.Scene(mesh).render(spp=1, size=(5, 5), integrator="albedo", camera=view)
    np.testing.assert_allclose(seen.array[2, 2], [1, 0, 0], atol=1e-6)
    mesh.visual.vertex_colors = np.tile([0, 0, 255, 255], (len(mesh.vertices), 1))
    seen = lumbre.Scene(mesh).render(spp=1, size=(5, 5), integrator="albedo", camera=view)
    np.testing.assert_allclose(seen.array[2, 2], [0, 0, 1], atol=1e-6)
    with pytest.raises(lumbre.LumbreError, match="faces are missing"):
        lumbre.Mesh(np.eye(3))
    with pytest.raises(lumbre.LumbreError, match="no trimesh.Trimesh"):
        lumbre.Mesh.from_trimesh([1])


def test_colours_are_materials() -> None:
    for given, expected in [((1, 0, 0), (1, 0, 0)), ("red", (1, 0, 0)), (0.25, (0.25, 0.25, 0.25)), ("#00f", (0, 0, 1))]:
        sphere = lumbre.Sphere(material=given)
        assert isinstance(sphere.material, lumbre.Diffuse)
        view = lumbre.Perspective((0, -4, 0), fov=20)
        seen = lumbre.Scene(sphere).render(spp=1, size=(3, 3), integrator="albedo", camera=view).array[1, 1]
        np.testing.assert_allclose(seen, expected, atol=1e-6)
    with pytest.raises(lumbre.LumbreError, match='no colour "redd".*did you mean red'):
        lumbre.Sphere(material="redd")
    with pytest.raises(lumbre.LumbreError, match="material is no material"):
        lumbre.Sphere(material=object())
    with pytest.raises(lumbre.LumbreError, match="reflectance"):
        lumbre.Sphere(material=(1, 0))


def test_an_expression_is_the_surface_where_it_is_zero() -> None:
    o, d = random_rays(400)
    bounds = ((-3, -4, 0), (4, 2, 6))
    for text, shape in [
        ("(x - 0.5)**2 + (y + 1)**2 + (z - 3)**2 - 2.5**2", lumbre.Sphere(center=(0.5, -1, 3), radius=2.5)),
        ("length(length(x - 0.5, y + 1) - 2, z - 3) - 0.5", lumbre.Torus(major=2, minor=0.5, center=(0.5, -1, 3))),
        ("max(abs(x - 0.5) - 1, abs(y + 1) - 1, abs(z - 3) - 1)", lumbre.Box(p0=(-0.5, -2, 2), p1=(1.5, 0, 4))),
    ]:
        implicit, exact = lumbre.Scene(lumbre.Implicit(text, bounds)), lumbre.Scene(shape)
        found, expected = implicit.cast(o, d), exact.cast(o, d)
        assert expected.hit.sum() > 40
        np.testing.assert_array_equal(found.hit, expected.hit)
        np.testing.assert_allclose(found.t[found.hit], expected.t[found.hit], rtol=1e-9)
        np.testing.assert_array_equal(implicit.count(o, d), exact.count(o, d))
        inside = implicit.inside([[0.5, -1.0, 3.0], [2.5, -1.0, 3.0]])
        np.testing.assert_array_equal(inside, exact.inside([[0.5, -1.0, 3.0], [2.5, -1.0, 3.0]]))
    for text, message in [
        ("x +", "found its end; expected a number, a name or a parenthesis"),
        ("2x", 'found "x" at position 2; expected an operator'),
        ("x**0.3", "a whole exponent from -64 to 64, or 0.5"),
        ("w", 'no name "w"'),
        ("sqr(x)", 'no function "sqr".*did you mean sqrt'),
        ("sqrt(x, y)", "sqrt has 2 arguments .expected one"),
        ("min(x)", "min has 1 arguments .expected two or more"),
        ("(x", 'expected "\\)"'),
        ("(" * 300 + "x" + ")" * 300, "parentheses in each other"),
        ("x+" * 5000 + "x", "too long"),
        ("tan(" * 60 + "x" + ")" * 60, "too long"),
        ("x+(" * 60 + "x" + ")" * 60, "too long"),
    ]:
        with pytest.raises(lumbre.LumbreError, match=message):
            lumbre.Implicit(text)
    with pytest.raises(lumbre.LumbreError, match="two corners"):
        lumbre.Implicit("x", bounds=3)
    with pytest.raises(lumbre.LumbreError, match="expression is no text"):
        lumbre.Implicit(lambda x, y, z: x)


def test_values_of_expressions_are_those_of_python() -> None:
    for text, value in [
        ("-x**2 + 4", -4 + 4),
        ("x - y - z", 2 - -3 - 0.5),
        ("x / z * 3", 12),
        ("y**-2", 1 / 9),
        ("x * z**-1 - 1", 3),
        ("min(x, y) + 1e1", 7),
        ("exp(0) + cos(pi) + tan(0) + sin(0)", 0),
        ("sqrt(x) ^ 2", 2),
        ("z**0.5 * z**0.5", 0.5),
    ]:
        # The plane w = value of a function that does not depend on where the ray is but for its end.
        moved = text.replace("exp", "E").replace("max", "M").replace("x", "2").replace("E", "exp").replace("M", "max")
        moved = moved.replace("y", "(-3)").replace("z", "0.5")
        scene = lumbre.Scene(lumbre.Implicit(f"z - ({moved})", ((-1, -1, -100), (1, 1, 100))))
        t = scene.cast([[0.0, 0.0, 90.0]], [[0.0, 0.0, -1.0]]).t
        np.testing.assert_allclose(90 - t, value, atol=1e-12, err_msg=text)


def test_points_without_an_answer_are_nan_and_said() -> None:
    dented = lumbre.Sphere(radius=2) - lumbre.Sphere(center=(2, 0, 0))
    scene = lumbre.Scene([dented, lumbre.Sphere(center=(50, 0, 0))])
    with pytest.warns(UserWarning, match="the nearest point is not known for 1 of 2 points: "):
        # The sphere's nearest point is cut away.
        nearest = scene.closest_point([[3.0, 0.0, 0.0], [49.0, 1.0, 0.0]])
    assert np.isnan(nearest.distance[0]) and nearest.shape[0] == -1 and np.isnan(nearest.point[0]).all()
    np.testing.assert_allclose(nearest.distance[1], np.sqrt(2) - 1)


def test_a_medium_takes_light() -> None:
    behind = lumbre.Box(p0=(-9, 5, -9), p1=(9, 6, 9), emission=1.0, material=0.0)
    camera = lumbre.Perspective((0, -9, 0), fov=5)

    def seen(**fill: object) -> float:
        fog = lumbre.Box(p0=(-2, -1, -2), p1=(2, 1, 2), **fill)
        return float(lumbre.Scene([behind, fog], camera=camera).render(spp=64, size=(3, 3)).array.mean())

    # Two units thick: what is left is exp(-2 * 0.5).
    assert abs(seen(medium=lumbre.Medium(absorption=0.5, scattering=0.0)) - np.exp(-1)) < 0.02
    assert seen(medium=lumbre.Medium(absorption=0.0, scattering=0.0)) > 0.999
    glass = seen(material=lumbre.Glass(1.0001), medium=lumbre.Medium(absorption=0.5, scattering=0.0))
    assert abs(glass - np.exp(-1)) < 0.02
    assert len(lumbre.Medium.measured("Wholemilk").scattering) == 3
    for make, message in [
        (lambda: lumbre.Medium(asymmetry=2), "asymmetry is out of range"),
        (lambda: lumbre.Medium(absorption=-1), "absorption is no colour"),
        (lambda: lumbre.Medium.measured("Wholemilc"), "did you mean Wholemilk"),
        (lambda: lumbre.Sphere(medium=3), "medium is no medium"),
    ]:
        with pytest.raises(lumbre.LumbreError, match=message):
            make()


def test_ribbons_face_along_their_normals() -> None:
    points = [[[0.0, 0, -1], [0, 0, 0], [0, 0, 1]]]
    ribbon = lumbre.Curves(points, 0.5, kind="ribbon", normals=[[[1.0, 0, 0]] * 3])
    scene = lumbre.Scene(ribbon)
    # From the front it is as wide as it is, from its edge it is not there.
    assert scene.occluded([[5.0, 0.2, 0.1]], [[-1.0, 0, 0]])[0]
    assert not scene.occluded([[0.2, -5.0, 0.1]], [[0.0, 1.0, 0]])[0]
    with pytest.raises(lumbre.LumbreError, match="normals are for ribbons"):
        lumbre.Curves(points, 0.5, normals=[[[1.0, 0, 0]] * 3])
    with pytest.raises(lumbre.LumbreError, match="one for each point"):
        lumbre.Curves(points, 0.5, kind="ribbon", normals=[[[1.0, 0, 0]] * 2])


def test_maps_move_turn_and_scale() -> None:
    place = lumbre.translate((1, 2, 3)) @ lumbre.rotate("z", 90) @ lumbre.scale(2, 1, 1)
    np.testing.assert_allclose(place @ [1, 0, 0, 1], [1, 4, 3, 1], atol=1e-15)
    for degrees in (0, 90, 180, 270, -90, 720):
        assert set(np.unique(lumbre.rotate((0, 0, 3), degrees))) <= {-1.0, 0.0, 1.0}
    about = lumbre.rotate("y", 37, about=(4, 5, 6))
    np.testing.assert_allclose(about @ [4, 9, 6, 1], [4, 9, 6, 1])
    for make, message in [
        (lambda: lumbre.scale(0), "scale is out of range"),
        (lambda: lumbre.rotate("w", 3), "axis is unknown"),
        (lambda: lumbre.rotate((0, 0, 0), 3), "axis is no direction"),
        (lambda: lumbre.rotate("x", np.nan), "degrees are out of range"),
        (lambda: lumbre.translate(1, 2), "translate is no triple"),
    ]:
        with pytest.raises(lumbre.LumbreError, match=message):
            make()


def everything() -> list[lumbre.Shape | lumbre.Instances]:
    vertices, faces = ball(1)
    vertices = vertices.astype(np.float32)
    checks = lumbre.Texture(np.indices((4, 4)).sum(axis=0) % 2 * 0.8, scale=(3, 2), filter="nearest")
    return [
        lumbre.Mesh(vertices, faces, normals=vertices, uvs=vertices[:, :2], material=lumbre.Diffuse(checks)),
        lumbre.Sphere(center=(3, 0, 1), radius=0.75, material=lumbre.Metal((0.9, 0.6, 0.2), roughness=0.2)),
        lumbre.Plane(point=(0, 0, -2), material=lumbre.Coated((0.3, 0.4, 0.5), roughness=0.1)),
        lumbre.Box(material=lumbre.Principled((0.2, 0.5, 0.7), metallic=0.5), transform=lumbre.rotate("x", 30) @ lumbre.scale(1, 2, 0.5)),
        lumbre.Cylinder(p0=(-3, 0, 0), p1=(-3, 1, 2), radius=0.4, material=lumbre.Translucent(0.3, transmittance=0.4)),
        lumbre.Cone(p0=(5, 0, 0), p1=(5, 0, 2), material=lumbre.Mix(lumbre.Diffuse(0.8), lumbre.Metal(0.9), 0.25)),
        lumbre.Capsule(p0=(-4, -2, 0), p1=(-4, -1, 0), radius=0.3, material=lumbre.Glass(1.4)),
        lumbre.Torus(center=(0, -3, 0), axis=(1, 2, 3), material=(0.9, 0.1, 0.1)),
        lumbre.Disk(center=(4, 3, 0), normal=(1, -1, 1), inner_radius=0.25),
        lumbre.Paraboloid(transform=lumbre.translate(-5, 3, 0), material=lumbre.ThinGlass()),
        lumbre.Hyperboloid(transform=lumbre.translate(-2, 5, 0)),
        lumbre.Quadric(coefficients=(1, 2, 3, 0.1, 0, 0, 0, 0, 0, -0.4), transform=lumbre.translate(2, 5, 0.3)),
        lumbre.Triangle(p0=(0, 8, 0.1), p1=(1, 8, 0), p2=(0, 8, 1)),
        lumbre.Box(p0=(6, 0, 0), p1=(7, 1, 1), material=0.6)
        - (lumbre.Sphere(center=(6.5, 0.5, 1), radius=0.4) | lumbre.Capsule(p0=(6, 0, 1))),
        lumbre.Sphere(center=(0, -2, 3), radius=0.3, emission=(4, 5, 6)),
        lumbre.Box(p0=(2, -4, 0), p1=(3, -3, 1), medium=lumbre.Medium(scattering=(1, 2, 3), absorption=0.25)),
        lumbre.Instances([lumbre.Sphere(radius=0.2, material="teal")], np.stack([lumbre.translate(i, -5, 0) for i in range(3)])),
    ]


@pytest.mark.parametrize(
    "camera",
    [
        lumbre.Perspective((1, -14, 5), target=(0.5, 0, 0.5), fov=40, lens_radius=0.05),
        lumbre.Orthographic((1, -14, 5), height=9),
        lumbre.Pinhole(20, 22, 12.5, 8, (24, 16), lumbre.translate(1, -14, 2) @ lumbre.rotate("x", -85)),
    ],
    ids=lambda camera: type(camera).__name__,
)
def test_a_saved_scene_is_the_same_scene(camera: lumbre.Camera, tmp_path) -> None:
    lights = [
        lumbre.PointLight((3, -5, 8), (20, 30, 40)),
        lumbre.SpotLight((-4, -6, 9), target=(0, 0, 1), intensity=90),
        lumbre.SunLight(azimuth=120, elevation=35, irradiance=1.5),
        lumbre.SunLight(azimuth=20, elevation=25, turbidity=5),
        lumbre.EnvironmentLight((0.2, 0.3, 0.4)),
        lumbre.SkyLight(azimuth=120, elevation=35, radiance=0.25),
    ]
    scene = lumbre.Scene(everything(), camera=camera, lights=lights)
    path = tmp_path / "all.pbrt"
    scene.save(path)
    again = lumbre.load(path, strict=True)
    o, d = random_rays(6000)
    before, after = scene.cast(o * 2, d), again.cast(o * 2, d)
    assert set(before.shape.tolist()) >= set(range(12))
    np.testing.assert_array_equal(after.t, before.t)
    np.testing.assert_array_equal(after.normal, before.normal)
    for integrator, tolerance in (("normals", 0.0), ("albedo", 1e-5), ("path", 0.05)):
        options = {"spp": 16 if integrator == "path" else 1, "size": (24, 16), "integrator": integrator}
        one, two = scene.render(**options).array, again.render(**options).array
        assert one.std() > 0.01
        np.testing.assert_allclose(two.mean(axis=(0, 1)), one.mean(axis=(0, 1)), rtol=tolerance, atol=1e-6)
        if tolerance == 0:
            np.testing.assert_array_equal(two, one)


@pytest.mark.parametrize(
    "shape, message",
    [
        (lumbre.Implicit("x"), "Implicit is not saved"),
        (lumbre.Curves([[[0, 0, 0], [0, 0, 1]]], 0.1), "Curves are not saved"),
        (lumbre.Patch(p00=(0, 0, 0), p10=(1, 0, 0), p01=(0, 1, 0), p11=(1, 1, 1)), "Patch is not saved"),
        (lumbre.Mesh(np.eye(3), [[0, 1, 2]], colors=np.eye(3)), "colors is not saved"),
        (lumbre.Sphere(material=lumbre.Principled(clearcoat=1)), "clearcoat is not saved"),
        (lumbre.Sphere(material=lumbre.Diffuse(lumbre.Texture(np.eye(2), wrap="mirror"))), "mirror"),
    ],
    ids=str,
)
def test_what_a_file_cannot_hold_is_said_and_leaves_no_file(shape, message, tmp_path) -> None:
    scene = lumbre.Scene([shape], camera=lumbre.Perspective((0, -5, 0)), lights=[lumbre.EnvironmentLight(1)])
    with pytest.raises(lumbre.LumbreError, match=message):
        scene.save(tmp_path / "a.pbrt")
    assert not list(tmp_path.iterdir())


def test_saving_says_what_is_missing(triangle: lumbre.Scene, tmp_path) -> None:
    camera, light = lumbre.Perspective((0, -5, 0)), lumbre.EnvironmentLight(1)
    for scene, name, message in [
        (triangle, "a.pbrt", "it is in .*model.obj"),
        (lumbre.Scene([triangle], camera=camera, lights=[light]), "a.pbrt", "a scene of files in a scene is not saved"),
        (lumbre.Scene(lumbre.Sphere(), lights=[light]), "a.pbrt", "expected a camera"),
        (lumbre.Scene(lumbre.Sphere(), camera=camera), "a.pbrt", "expected a light"),
        (lumbre.Scene(lumbre.Sphere(), camera=camera, lights=[light]), "a.obj", "saved as .pbrt"),
    ]:
        with pytest.raises(lumbre.LumbreError, match=message):
            scene.save(tmp_path / name)
    precise = lumbre.Scene(lumbre.Mesh(np.eye(3) * 0.1, [[0, 1, 2]]), camera=camera, lights=[light])
    with pytest.warns(UserWarning, match="3 vertices of meshes are rounded"):
        precise.save(tmp_path / "b.pbrt")


def test_names_that_people_try_are_answered_with_ours() -> None:
    scene = lumbre.Scene([lumbre.Sphere()])
    for call, message in [
        (lambda: lumbre.Sphere(r=2), "Sphere has no argument r .*did you mean radius"),
        (lambda: lumbre.Sphere(color=(1, 0, 0)), "did you mean material"),
        (lambda: lumbre.Diffuse(color=(1, 0, 0)), "did you mean reflectance"),
        (lambda: lumbre.Perspective((0, -5, 0), look_at=(0, 0, 1)), "did you mean target"),
        (lambda: lumbre.Mesh(np.eye(3), triangles=[[0, 1, 2]]), "did you mean faces"),
        (lambda: lumbre.Torus(major_radius=2), "did you mean major"),
        (lambda: scene.render(samples=4), "Scene.render has no argument samples .*did you mean spp"),
        (lambda: scene.render(width=4), "did you mean size"),
        (lambda: scene.render(resolution=(4, 4)), "did you mean size"),
        (lambda: lumbre.Scene([], light=[]), "did you mean lights"),
        (lambda: lumbre.load("a.glb", strct=True), "did you mean strict"),
    ]:
        with pytest.raises(TypeError, match=message):
            call()
    hits = scene.cast([[0.0, 0.0, 5.0]], [[0.0, 0.0, -1.0]])
    image = scene.render(spp=1, size=(4, 4))
    for owner, name, message in [
        (hits, "normals", "Hits has no normals: it is normal"),
        (hits, "distance", "it is t"),
        (hits, "triangle", "it is prim"),
        (image, "show", "save.path."),
        (image, "to_pil", "PIL.Image.open"),
        (image, "size", "shape is"),
        (image, "width", "shape is"),
        (scene, "intersect", "cast.origins"),
        (scene, "bbox", "bounds has"),
        (scene, "rendr", "did you mean render"),
    ]:
        with pytest.raises(AttributeError, match=message):
            getattr(owner, name)
    assert not hasattr(scene, "foo") and not hasattr(hits, "__array_interface__")
    fewer = scene.cast([[0.0, 0.0, 5.0]], [[0.0, 0.0, -1.0]], fields=("t",))
    with pytest.raises(AttributeError, match="cast with it among the fields"):
        _ = fewer.normal


@pytest.mark.parametrize(
    "kind", [lumbre.Sphere, lumbre.Diffuse, lumbre.Perspective, lumbre.SunLight, lumbre.Mesh, lumbre.Pinhole, lumbre.Medium]
)
def test_help_is_for_users(kind: type) -> None:
    text = io.StringIO()
    with contextlib.redirect_stdout(text):
        pydoc.doc(kind, output=text)
    shown = pydoc.plain(text.getvalue())
    for word in ("dataclass", "__match_args__", "__post_init__", "__setstate__", "__replace__", "*arguments", "_made"):
        assert word not in shown, word
    first = shown.splitlines()[2]
    assert first.startswith(f"class {kind.__name__}("), first
    assert ">>> " in shown


def test_every_public_name_has_a_docstring_with_an_example() -> None:
    without = []
    for name in lumbre.__all__:
        text = getattr(lumbre, name).__doc__ or ""
        assert len(text) > 20, name
        if ">>>" not in text:
            without.append(name)
    # Bases, results and functions of files.
    assert set(without) <= {
        "Camera",
        "Image",
        "Light",
        "LumbreError",
        "Material",
        "Nearest",
        "SceneMesh",
        "Shape",
        "read_image",
        "thread_count",
    }, without
