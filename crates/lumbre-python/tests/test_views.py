"""Any view of any scene: cameras of data sets, one tree for all of them, and what else a picture is asked to show."""

from __future__ import annotations

import pickle
import warnings

import numpy as np
import pytest
from conftest import SCENES, ball

import lumbre


def turned(degrees: float, distance: float = 9.0) -> np.ndarray:
    """World from camera in OpenCV's axes: on a circle about the z axis, looking at it, with z upwards in the picture."""
    eye = lumbre.rotate("z", degrees)[:3, :3] @ np.array([0.0, -distance, 2.0])
    forward = -eye / np.linalg.norm(eye)
    right = np.cross(forward, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    pose = np.eye(4)
    pose[:3, :3] = np.stack([right, np.cross(forward, right), forward], axis=1)
    pose[:3, 3] = eye
    return pose


@pytest.fixture(scope="module")
def model(tmp_path_factory: pytest.TempPathFactory) -> lumbre.Scene:
    """A file without camera and light."""
    vertices, faces = ball(2, 1.5, (0.0, 0.0, 0.0))
    lines = [f"v {x} {y} {z}" for x, y, z in vertices] + [f"f {a} {b} {c}" for a, b, c in faces + 1]
    path = tmp_path_factory.mktemp("model") / "ball.obj"
    path.write_text("\n".join(lines))
    return lumbre.load(path)


def test_fifty_views_of_a_model_share_one_tree(model: lumbre.Scene) -> None:
    before = model._native.trees()
    pictures = []
    for i in range(50):
        camera = lumbre.Perspective.from_intrinsics(40, 40, 16, 12, (32, 24), turned(7.2 * i))
        pictures.append(model.render(camera=camera, spp=1, denoise=False).array)
    # One with ground under the model, besides that of ray queries.
    assert model._native.trees() <= before + 1
    assert all(picture.shape == (24, 32, 3) for picture in pictures)
    assert len({picture.tobytes() for picture in pictures}) == 50
    # From below, ground that nobody asked for would hide the model: that view needs no other tree than ray queries.
    below = lumbre.Perspective((0, -6, -5), target=(0, 0, 0))
    model.render(camera=below, spp=1, size=(16, 16))
    for azimuth in (10, 100, 200):
        model.render(azimuth=azimuth, spp=1, size=(16, 16))
        model.render(azimuth=azimuth, env=lumbre.EnvironmentLight((0.2, 0.3, 0.5)), spp=1, size=(16, 16))
    trees = model._native.trees()
    assert trees <= before + 2
    model.render(azimuth=10, spp=1, size=(16, 16), ground="none")
    assert model._native.trees() == trees


def test_a_view_is_that_of_a_scene_with_this_camera_and_light() -> None:
    shapes = [lumbre.Torus(major=1.5, minor=0.4, material="orange"), lumbre.Plane(point=(0, 0, -0.5))]
    sky, camera = lumbre.EnvironmentLight(0.7), lumbre.Perspective((0, -7, 3), fov=35)
    whole = lumbre.Scene(shapes, camera=camera, lights=[sky])
    other = lumbre.Scene(shapes, camera=lumbre.Perspective((5, 0, 2)), lights=[lumbre.EnvironmentLight(2.0)])
    expected = whole.render(spp=2, size=(24, 16)).array
    shown = other.render(spp=2, size=(24, 16), camera=camera, env=sky, ground="none", background="env", denoise=False).array
    np.testing.assert_array_equal(shown, expected)
    assert other._native.trees() == 1


@pytest.mark.parametrize("axes, flip", [("opencv", np.eye(4)), ("opengl", np.diag([1.0, -1.0, -1.0, 1.0]))])
def test_a_calibrated_camera_sees_points_where_its_matrix_projects_them(axes: str, flip: np.ndarray) -> None:
    fx, fy, cx, cy, size = 300.0, 280.0, 170.5, 110.25, (320, 240)
    pose = turned(33.0) @ flip
    camera = lumbre.Perspective.from_intrinsics(fx, fy, cx, cy, size, pose, axes=axes)
    origins, directions = camera.rays()
    assert directions.shape == (240, 320, 3)
    np.testing.assert_allclose(origins[10, 20], pose[:3, 3])
    # A place of the world by the pinhole's equations, and the ray of the pixel in which it lies.
    world = np.array([0.4, -0.3, 0.7])
    x, y, z = (np.linalg.inv(turned(33.0)) @ [*world, 1.0])[:3]
    u, v = fx * x / z + cx, fy * y / z + cy
    row, column = int(v), int(u)
    along = (world - origins[row, column]) / np.linalg.norm(world - origins[row, column])
    ray = directions[row, column]
    # The centre of the pixel is half a pixel away at most.
    here = np.array([(column + 0.5 - cx) / fx, (row + 0.5 - cy) / fy, 1.0])
    expected = turned(33.0)[:3, :3] @ (here / np.linalg.norm(here))
    np.testing.assert_allclose(ray, expected, atol=1e-12)
    assert np.arccos(ray @ along) < 0.8 / 280
    again = pickle.loads(pickle.dumps(camera))
    np.testing.assert_array_equal(again.rays()[1], directions)


@pytest.mark.parametrize(
    "change, message",
    [
        ({"fx": 0}, "fx is out of range"),
        ({"pose": np.eye(3)}, "pose has the wrong shape"),
        ({"pose": 2 * np.eye(4) - np.diag([0, 0, 0, 1.0])}, "pose is no rigid motion .found columns of lengths"),
        ({"pose": np.diag([1.0, 1.0, -1.0, 1.0])}, "pose is a mirror"),
        ({"pose": lumbre.translate(1, 2, 3).T}, "it seems transposed"),
        ({"axes": "blender"}, "expected opencv, opengl"),
        ({"size": (0, 3)}, "size is out of range"),
        ({"cx": np.nan}, "not finite"),
    ],
)
def test_numbers_that_make_no_camera_are_refused(change, message) -> None:
    given = {"fx": 50, "fy": 50, "cx": 16, "cy": 12, "size": (32, 24), "pose": np.eye(4)}
    with pytest.raises(lumbre.LumbreError, match=message):
        lumbre.Perspective.from_intrinsics(**{**given, **change})


def test_up_along_the_view_is_said() -> None:
    with pytest.raises(lumbre.LumbreError, match=r"up is parallel to the view .* such as up=\(0, 1, 0\)"):
        lumbre.Perspective((0, 0, 5))
    with pytest.raises(lumbre.LumbreError, match=r"up is parallel to the view .* such as up=\(0, 0, 1\)"):
        lumbre.Orthographic((5, 0, 0), up=(1, 0, 0))


def test_every_kind_of_camera_is_for_every_scene(model: lumbre.Scene) -> None:
    file = lumbre.load(SCENES / "csg" / "csg.pbrt")
    cameras = [
        lumbre.Perspective((4, -9, 3), fov=30),
        lumbre.Orthographic((4, -9, 3), height=8),
        lumbre.Panorama((0, -4, 1)),
        lumbre.Pinhole(20, 20, 8, 6, (16, 12), turned(5)),
    ]
    for scene in (model, file):
        seen = {scene.render(camera=camera, spp=1, size=(16, 12), integrator="normals").array.tobytes() for camera in cameras}
        assert len(seen) == 4
    told = file.explain((8, 6), size=(16, 12), camera=cameras[0])
    assert told["sections"]


def test_azimuth_and_zoom_are_those_of_the_program(model: lumbre.Scene, tmp_path) -> None:
    import subprocess
    import sys

    path = model._source["paths"][0]
    ours = model.render(spp=1, size=(24, 18), azimuth=40, elevation=20, zoom=1.5)
    out = tmp_path / "program.pfm"
    words = ["--azimuth", "40", "--elevation", "20", "--zoom", "1.5", "--spp", "1", "--denoise", "none", "--size", "24x18", "-q"]
    subprocess.run([sys.executable, "-m", "lumbre", "render", str(path), *words, "-o", str(out)], check=True)
    ours = model.render(spp=1, size=(24, 18), azimuth=40, elevation=20, zoom=1.5, denoise=False)
    np.testing.assert_array_equal(lumbre.read_image(out), ours.array)


def test_overrides_are_those_of_the_program() -> None:
    scene = lumbre.Scene([lumbre.Sphere(material=0.8)], lights=[lumbre.EnvironmentLight(1.0)], camera=lumbre.Perspective((0, -4, 0)))
    red = scene.render(spp=1, size=(9, 9), integrator="albedo", overrides={"material.0.reflectance": (1, 0.25, 0)})
    np.testing.assert_allclose(red.array[4, 4], [1, 0.25, 0], atol=1e-6)
    plain = scene.render(spp=1, size=(9, 9), integrator="albedo")
    np.testing.assert_allclose(plain.array[4, 4], 0.8, atol=1e-6)
    trees = scene._native.trees()
    scene.render(spp=1, size=(9, 9), overrides={"material.0.reflectance": (1, 0.25, 0)})
    assert scene._native.trees() == trees
    named = scene.render(spp=1, size=(9, 9), integrator="albedo", overrides={"material.0.reflectance": "red", "camera.fov": 20})
    np.testing.assert_allclose(named.array[4, 4], [1, 0, 0], atol=1e-6)
    with pytest.raises(lumbre.LumbreError, match="overrides: .* did you mean reflectance"):
        scene.render(spp=1, overrides={"material.0.reflectanc": 1})


def test_what_is_behind_and_around_is_chosen(model: lumbre.Scene, tmp_path) -> None:
    size = (20, 20)

    def corner(**options: object) -> np.ndarray:
        return model.render(spp=1, size=size, ground="none", denoise=False, **options).array[0, 0]

    np.testing.assert_allclose(corner(background=(0.25, 0.5, 0.75)), [0.25, 0.5, 0.75], atol=1e-6)
    np.testing.assert_allclose(corner(background="red"), [1, 0, 0], atol=1e-6)
    np.testing.assert_allclose(corner(background="env", env=(0.1, 0.2, 0.3)), [0.1, 0.2, 0.3], atol=1e-3)
    lumbre.write_image(tmp_path / "back.pfm", np.full((4, 4, 3), 0.125))
    np.testing.assert_allclose(corner(background=tmp_path / "back.pfm"), 0.125, atol=1e-6)
    assert model.render(spp=1, size=size, ground="none", background="transparent").alpha[0, 0] == 0
    image = np.zeros((8, 16, 3), dtype=np.float32)
    image[:4] = [0, 0, 1]
    lumbre.write_image(tmp_path / "sky.pfm", image)
    above = lumbre.Perspective((0, -9, 0), target=(0, -9, 5), up=(0, 1, 0))
    for env in (image, tmp_path / "sky.pfm"):
        # The model is y up, so that its sky is, too.
        up = lumbre.Perspective((0, 0, 9), target=(0, 5, 9), up=(0, 0, 1))
        assert model.render(spp=1, size=(4, 4), camera=up, env=env, background="env", denoise=False).array[2, 2, 2] > 0.9
    assert model.render(spp=1, size=(4, 4), camera=above, env=lumbre.SkyLight(), background="env").array.mean() > 0.05
    for options, message in [
        ({"camera": lumbre.Perspective((0, -5, 1)), "azimuth": 3}, "camera and azimuth exclude each other"),
        ({"camera": 0, "elevation": 3}, "camera and elevation exclude each other"),
        ({"camera": lumbre.Perspective((0, -5, 1)), "zoom": 3}, "camera and zoom exclude each other"),
        ({"transparent": True, "background": "red"}, "transparent and background exclude"),
        ({"background": "rad"}, "did you mean red"),
        ({"ground": "floor"}, "there is no ground"),
        ({"env": object()}, "env is no light from all around"),
        ({"env": np.zeros((3, 5, 3))}, "twice as wide"),
        ({"azimuth": "3"}, "azimuth is out of range"),
        ({"zoom": 0}, "zoom is out of range"),
        ({"overrides": ["camera.fov=3"]}, "overrides have no names"),
        ({"camera": "left"}, "no camera"),
        ({"camera": 2.5}, "expected a Camera, or the position or name"),
    ]:
        with pytest.raises(lumbre.LumbreError, match=message):
            model.render(spp=1, size=(4, 4), **options)


def test_depth_of_a_miss_is_infinite() -> None:
    scene = lumbre.Scene([lumbre.Sphere()], camera=lumbre.Perspective((0, -5, 0), fov=60), lights=[lumbre.EnvironmentLight(1)])
    depth = scene.render(spp=4, size=(15, 15), features=True).feature("depth")
    assert depth[0, 0] == np.inf and abs(depth[7, 7] - 4) < 0.05


def test_pictures_are_pickled_with_all_that_they_show(tmp_path) -> None:
    scene = lumbre.Scene([lumbre.Sphere(material="#8040c0")])
    for options in ({}, {"transparent": True}, {"background": (0.1, 0.2, 0.3)}, {"crop": (3, 2, 11, 9)}):
        image = scene.render(spp=2, size=(16, 12), features=True, **options)
        again = pickle.loads(pickle.dumps(image))
        np.testing.assert_array_equal(again.array, image.array)
        assert again.stats == image.stats and repr(again) == repr(image)
        for name in ("albedo", "normal", "depth", "uv"):
            np.testing.assert_array_equal(again.feature(name), image.feature(name))
        assert (again.alpha is None) == (image.alpha is None)
        for ending, layers in (("exr", ["depth"]), ("png", [])):
            for number, picture in enumerate((image, again)):
                picture.save(tmp_path / f"{number}.{ending}", layers=layers, precision="float")
            one, two = (lumbre.read_image(tmp_path / f"{number}.{ending}") for number in range(2))
            np.testing.assert_array_equal(two, one)


def test_sun_and_sky_stand_where_they_are_said_to() -> None:
    floor = lumbre.Plane(material=1.0)
    camera = lumbre.Perspective((0, 0, 9), target=(0, 0, 0), up=(0, 1, 0), fov=1)
    noon = lumbre.Scene(floor, camera=camera, lights=lumbre.SunLight(azimuth=200, elevation=30, irradiance=3.0, angle=0))
    np.testing.assert_allclose(noon.render(spp=1, size=(3, 3)).array, 1.5 / np.pi, rtol=1e-4)
    # A disc, whose points are a little higher and lower.
    disc = lumbre.Scene(floor, camera=camera, lights=lumbre.SunLight(azimuth=200, elevation=30, irradiance=3.0))
    np.testing.assert_allclose(disc.render(spp=64, size=(3, 3)).array, 1.5 / np.pi, rtol=2e-3)
    # What the air leaves of the sun: 50,000 to 80,000 lux on what faces it, redder than white.
    model = lumbre.Scene(floor, camera=camera, lights=lumbre.SunLight(elevation=30)).render(spp=64, size=(3, 3)).array.mean(axis=(0, 1))
    assert 0.25 < model[1] < 0.4 and model[0] > 1.1 * model[2]
    for wrong in (lumbre.SunLight, lumbre.SkyLight):
        with pytest.raises(lumbre.LumbreError, match="turbidity"):
            wrong(turbidity=0.5)
    with pytest.raises(lumbre.LumbreError, match="below the horizon"):
        lumbre.SkyLight(elevation=-1)
    night = lumbre.Scene(floor, camera=camera, lights=[lumbre.SunLight(elevation=-5)])
    assert night.render(spp=1, size=(3, 3)).array.max() == 0
    for azimuth in (0, 90, 180, 270):
        sky = lumbre.SkyLight(azimuth=azimuth, elevation=25)
        scene = lumbre.Scene([lumbre.Sphere(center=(0, 0, -50))], lights=[sky])

        def seen(towards: tuple[float, float, float], scene: lumbre.Scene = scene) -> np.ndarray:
            view = lumbre.Perspective((0, 0, 0), target=towards, up=(0.1, 0.2, 0.9), fov=4)
            return scene.render(spp=4, size=(2, 2), camera=view, background="env", denoise=False).array.mean(axis=(0, 1))

        towards, away = (lumbre.sun_direction(azimuth + turn, 25) for turn in (0, 180))
        assert seen(towards).mean() > 3 * seen(away).mean()
        zenith = seen((0, 0, 1))
        assert zenith[2] > 1.5 * zenith[0]
    lamp = lumbre.AreaLight(center=(0, 0, 4), width=2, height=1, radiance=10)
    lit = lumbre.Scene([floor], camera=camera, lights=lamp)
    below = lit.render(spp=64, size=(3, 3), camera=lumbre.Perspective((0, 0, 3), up=(0, 1, 0), fov=1)).array.mean()
    # Of a rectangle 2 by 1 at distance 4, which is seen as 2 over 16 steradians, nearly.
    assert abs(below / (10 * 2 / 16 / np.pi) - 1) < 0.06


def test_the_sun_stands_where_the_ephemeris_has_it() -> None:
    import datetime

    # The example of Reda and Andreas, "Solar Position Algorithm for Solar Radiation Applications", 2008: 194.34 degrees, and 39.888 with
    # refraction, which is 0.016 at that height.
    when = datetime.datetime(2003, 10, 17, 12, 30, 30, tzinfo=datetime.timezone(datetime.timedelta(hours=-7)))
    azimuth, elevation = lumbre.solar_position(when, 39.742476, -105.1786)
    assert abs(azimuth - 194.34024) < 0.01 and abs(elevation - 39.872) < 0.01
    times = np.datetime64("2003-10-17T19:30:30") + np.arange(3) * np.timedelta64(1, "h")
    several = lumbre.solar_position(times, 39.742476, -105.1786)
    assert several[0].shape == (3,) and abs(several[0][0] - azimuth) < 1e-6
    with pytest.raises(lumbre.LumbreError, match="no time zone"):
        lumbre.solar_position(datetime.datetime(2003, 10, 17), 0, 0)


def test_nothing_warns_of_a_view(model: lumbre.Scene) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        model.render(camera=lumbre.Perspective((0, -6, 2)), spp=1, size=(8, 6), background="studio", ground="plane", env="studio")
