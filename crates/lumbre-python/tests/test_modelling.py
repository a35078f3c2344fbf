"""What scenes are made of: solids, materials with textures, and lights."""

from __future__ import annotations

import pickle
import warnings

import numpy as np
import pytest
from conftest import ball

import lumbre


def solids() -> tuple[lumbre.Shape, lumbre.Shape]:
    """A box, and a mesh about a sphere, that overlap in a corner."""
    vertices, faces = ball(2, radius=2.0, center=(2.5, 2.0, 1.5))
    return lumbre.Box(p0=(-1, -2, -1.5), p1=(2, 2.5, 1.5)), lumbre.Mesh(vertices, faces, material=lumbre.Metal(0.9))


@pytest.mark.parametrize(
    "combine, is_in",
    [
        (lambda a, b: a | b, lambda a, b: a | b),
        (lambda a, b: a & b, lambda a, b: a & b),
        (lambda a, b: a - b, lambda a, b: a & ~b),
        (lambda a, b: lumbre.Difference(b, a), lambda a, b: b & ~a),
        (lambda a, b: lumbre.Union(a - b, [lumbre.Sphere(center=(6, 0, 0)), b & a]), lambda a, b: a),
    ],
    ids=["union", "intersection", "difference", "other difference", "tree"],
)
def test_a_csg_has_the_points_that_its_operation_says(combine, is_in) -> None:
    box, mesh = solids()
    points = np.random.default_rng(3).uniform(-2.5, 4.5, size=(2000, 3))
    a, b = (lumbre.Scene(shape).inside(points) for shape in (box, mesh))
    assert min(a.sum(), b.sum(), (a & b).sum()) > 10
    near_other = np.linalg.norm(points - [6, 0, 0], axis=1) < 1
    solid = combine(box, mesh)
    found = lumbre.Scene(solid).inside(points)
    np.testing.assert_array_equal(found[~near_other], is_in(a, b)[~near_other])
    again = lumbre.Scene(pickle.loads(pickle.dumps(solid)))
    np.testing.assert_array_equal(again.inside(points), found)


def test_parts_of_a_csg_count_in_their_place_and_keep_their_materials() -> None:
    red, green, blue = (lumbre.Diffuse(tuple(row)) for row in np.eye(3))
    dented = lumbre.Difference(
        lumbre.Box(p0=(-2, -2, -2), p1=(2, 2, 2)),
        lumbre.Sphere(center=(0, 0, 2), radius=1.5, material=green),
        material=red,
        transform=np.diag([2.0, 2.0, 2.0, 1.0]),
    )
    ball = lumbre.Sphere(center=(9, 0, 0), radius=0.5, material=blue)
    scene = lumbre.Scene([lumbre.Disk(center=(-9, 0, 0)), dented, ball])
    origins = [[-9.0, 0.5, 9.0], [3.5, 3.5, 9.0], [0.0, 0.0, 9.0], [9.0, 0.0, 9.0]]
    hits = scene.cast(origins, [0.0, 0.0, -1.0])
    assert hits.shape.tolist() == [0, 1, 2, 3]
    assert hits.t.tolist() == [9.0, 5.0, 8.0, 8.5] and hits.front.all()
    np.testing.assert_array_equal(hits.normal, [[0, 0, 1]] * 4)
    above = lumbre.Orthographic((0, 0, 20), target=(0, 0, 0), up=(0, 1, 0), height=8)
    seen = lumbre.Scene([dented, ball], camera=above).render(spp=1, size=(32, 32), integrator="albedo").array
    np.testing.assert_allclose(seen[16, 16], [0, 1, 0], atol=1e-6)
    np.testing.assert_allclose(seen[2, 2], [1, 0, 0], atol=1e-6)


def test_what_makes_no_csg_is_refused() -> None:
    with pytest.raises(lumbre.LumbreError, match="found 1; expected two or more"):
        lumbre.Union(lumbre.Sphere())
    with pytest.raises(lumbre.LumbreError, match="is no shape: 3"):
        lumbre.Union(lumbre.Sphere(), 3)
    vertices, faces = ball(1)
    open_mesh = lumbre.Mesh(vertices, faces[1:])
    with pytest.raises(lumbre.LumbreError, match="not closed"):
        lumbre.Scene(lumbre.Sphere() | open_mesh)
    with pytest.raises(lumbre.LumbreError, match="operand 1 holds no shape"):
        lumbre.Scene(lumbre.Union(lumbre.Sphere(), []))


def flat(material: lumbre.Material | None, **more: object) -> lumbre.Scene:
    """A square; three units of each side are visible, from straight above: x and u to the right, y and v up, uv from 0 to 1."""
    corners = np.array([[-3, -3, 0], [3, -3, 0], [3, 3, 0], [-3, 3, 0]], dtype=np.float32)
    uvs = corners[:, :2] / 3 + 0.5
    square = lumbre.Mesh(corners, [[0, 1, 2], [0, 2, 3]], uvs=uvs, material=material, **more)
    camera = lumbre.Orthographic((0, 0, 5), target=(0, 0, 0), up=(0, 1, 0), height=3)
    return lumbre.Scene(square, camera=camera, lights=[lumbre.EnvironmentLight(1.0)])


def albedo(scene: lumbre.Scene, size: tuple[int, int] = (30, 30)) -> np.ndarray:
    return scene.render(spp=1, size=size, integrator="albedo").array


def test_arrays_are_textures_with_their_first_row_at_the_top() -> None:
    image = np.zeros((2, 3, 3), dtype=np.float32)
    image[0, 0], image[0, 2], image[1, 0] = (0.9, 0, 0), (0, 0.8, 0), (0.1, 0.2, 0.7)
    seen = albedo(flat(lumbre.Diffuse(lumbre.Texture(image, filter="nearest"))))
    np.testing.assert_allclose(seen[7::15, 5::10], image, atol=1e-6)
    # Bilinear, and as an array alone.
    blurred = albedo(flat(lumbre.Diffuse(image)))
    np.testing.assert_allclose(blurred[7, 15], 0.5 * (seen[7, 14] + seen[7, 16]), atol=0.1)
    assert not np.array_equal(seen, blurred)
    twice = lumbre.Texture(image, filter="nearest", scale=(2, 1))
    np.testing.assert_allclose(albedo(flat(lumbre.Diffuse(twice)))[7::15, 2::5], np.tile(image, (1, 2, 1)), atol=1e-6)
    black = lumbre.Texture(image, filter="nearest", scale=(2, 1), wrap="black")
    assert albedo(flat(lumbre.Diffuse(black)))[:, 17:].max() == 0


def test_integers_stand_for_0_to_1_and_are_srgb_where_they_are_colours() -> None:
    grey = np.full((2, 2), 188, dtype=np.uint8)
    light = ((188 / 255 + 0.055) / 1.055) ** 2.4
    for texels in (grey, grey.astype(np.uint16) * 257):
        np.testing.assert_allclose(albedo(flat(lumbre.Diffuse(texels))), light, rtol=1e-3)
        linear = lumbre.Texture(texels, encoding="linear")
        np.testing.assert_allclose(albedo(flat(lumbre.Diffuse(linear))), 188 / 255, rtol=1e-3)
    # As a number, it is what it says.
    ends = lumbre.Diffuse(0.0), lumbre.Diffuse(1.0)
    mixed = flat(lumbre.Mix(*ends, grey)).render(spp=256, size=(8, 8), integrator="albedo").array
    assert abs(mixed.mean() - 188 / 255) < 0.01


def test_numbers_vary_over_a_surface_too() -> None:
    left, right = 0.02, 0.9
    roughness = lumbre.Texture(np.array([[left, right]], dtype=np.float32), filter="nearest")
    lamp = lumbre.EnvironmentLight(1.0, np.random.default_rng(2).uniform(size=(8, 16, 3)))

    def picture(value: object) -> np.ndarray:
        scene = flat(lumbre.Metal(0.9, roughness=value))
        made = lumbre.Scene(scene._source["shapes"], camera=scene._source["camera"], lights=[lamp])
        return made.render(spp=4, size=(16, 16)).array

    both, smooth, rough = picture(roughness), picture(left), picture(right)
    # Pixels whose samples are all of one half.
    np.testing.assert_allclose(both[:, 2:6], smooth[:, 2:6], rtol=1e-5)
    np.testing.assert_allclose(both[:, 10:14], rough[:, 10:14], rtol=1e-5)
    assert abs(smooth - rough).max() > 0.1


def test_normal_maps_and_bump_maps_tilt_what_is_seen_of_a_surface() -> None:
    def normals(**maps: object) -> np.ndarray:
        return 2 * flat(lumbre.Diffuse(0.5, **maps)).render(spp=1, size=(12, 12), integrator="normals").array - 1

    np.testing.assert_allclose(normals(), np.broadcast_to([0, 0, 1], (12, 12, 3)), atol=1e-5)
    # Tangent space: x along u, which is x here.
    tilt = np.array([0.6, 0.0, 0.8])
    tilted = normals(normal_map=np.full((1, 1, 3), 0.5 + 0.5 * tilt, dtype=np.float32))
    np.testing.assert_allclose(tilted, np.broadcast_to(tilt, (12, 12, 3)), atol=0.01)
    # Heights that rise by 1 over the three units of u.
    ramp = np.linspace(0, 1, 64, dtype=np.float32)[None]
    bumped = normals(bump_map=ramp)[3:9, 4:8]
    slope = np.array([-1 / 3, 0.0, 1.0]) / np.linalg.norm([-1 / 3, 0.0, 1.0])
    np.testing.assert_allclose(bumped, np.broadcast_to(slope, bumped.shape), atol=0.02)


def test_a_mesh_shows_its_colours_unless_it_has_a_material() -> None:
    red, green, blue, white = colors = np.array([[1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 1]], dtype=float)
    seen = albedo(flat(None, colors=colors))
    # A quarter of the way from each corner of the square to the opposite one are the corners of the picture.
    np.testing.assert_allclose(seen[-1, 0], 0.75 * red + 0.25 * blue, atol=0.03)
    np.testing.assert_allclose(seen[0, -1], 0.25 * red + 0.75 * blue, atol=0.03)
    np.testing.assert_allclose(albedo(flat(lumbre.Diffuse(0.3), colors=colors)), 0.3, atol=1e-6)
    with pytest.raises(lumbre.LumbreError, match="colors"):
        flat(None, colors=[[1, 0, np.nan]] * 4)


@pytest.mark.parametrize(
    "material, reflected",
    [
        (lumbre.Diffuse(0.6), 0.6),
        (lumbre.Metal(0.7), 0.7),
        (lumbre.ThinGlass(1.5), 1.0),
        (lumbre.Translucent(0.3, 0.2), 0.5),
        (lumbre.Mix(lumbre.Diffuse(0.2), lumbre.Diffuse(0.8), 0.25), 0.35),
    ],
    ids=lambda value: type(value).__name__,
)
def test_in_even_light_a_surface_has_the_light_that_it_does_not_absorb(material, reflected: float) -> None:
    # A furnace: light of 1 from all around.
    again = pickle.loads(pickle.dumps(material))
    picture = flat(material).render(spp=256, size=(12, 12)).array
    assert abs(picture.mean() - reflected) < 0.01
    np.testing.assert_array_equal(flat(again).render(spp=256, size=(12, 12)).array, picture)


def test_coats_and_all_of_principled_absorb_no_less_than_nothing() -> None:
    for material in (
        lumbre.Coated(1.0, roughness=0.2),
        lumbre.Glass(1.5, roughness=0.3),
        lumbre.Principled(1.0, clearcoat=1.0, clearcoat_roughness=0.4, sheen_color=0.5, sheen_roughness=0.5),
        lumbre.Principled(1.0, transmission=1.0, attenuation_color=(0.2, 0.5, 0.9), attenuation_distance=2.0),
    ):
        vertices, faces = ball(2)
        scene = lumbre.Scene(
            lumbre.Mesh(vertices, faces, material=material),
            camera=lumbre.Perspective((0.5, -12, 3), target=(0.5, -1, 3), fov=20),
            lights=[lumbre.EnvironmentLight(1.0)],
        )
        mean = scene.render(spp=64, size=(12, 12), max_depth=20).array.mean(axis=(0, 1))
        assert (mean < 1.02).all(), (material, mean)
        if isinstance(material, lumbre.Principled) and material.attenuation_distance:
            assert 0.05 < mean[0] < mean[1] < mean[2] < 0.9
        else:
            assert (mean > 0.6).all(), (material, mean)


@pytest.mark.parametrize(
    "make, message",
    [
        (lambda: lumbre.Diffuse(np.zeros((2, 2, 5))), "wrong shape"),
        (lambda: lumbre.Texture(np.zeros(3)), "wrong shape"),
        (lambda: lumbre.Texture(np.array([["a"]])), "wrong kind"),
        (lambda: lumbre.Texture(np.array([[np.nan]])), "not finite"),
        (lambda: lumbre.Texture(np.zeros((2, 2)), wrap="repeet"), "did you mean repeat"),
        (lambda: lumbre.Texture(np.zeros((2, 2)), filter="sharp"), "filter"),
        (lambda: lumbre.Texture(np.zeros((2, 2)), encoding="gamma"), "encoding"),
        (lambda: lumbre.Metal(0.9, roughness=2.0), "roughness is out of range"),
        (lambda: lumbre.Metal(0.9, roughness="low"), "roughness is no number"),
        (lambda: lumbre.Diffuse(normal_map=0.5), "no image"),
        (lambda: lumbre.Mix(amount=1.5), "amount is out of range"),
        (lambda: lumbre.Mix(bump_map=np.eye(2)), "no maps of its own"),
        (lambda: lumbre.Glass(0.0), "ior"),
        (lambda: lumbre.Principled(attenuation_distance=0.0), "attenuation_distance"),
        (lambda: lumbre.SpotLight((0, 0, 1), target=(0, 0, 1)), "shines at no"),
        (lambda: lumbre.SpotLight((0, 0, 1), angle=20, falloff=30), "falloff"),
    ],
)
def test_what_makes_no_material_or_light_is_refused(make, message: str) -> None:
    with pytest.raises(lumbre.LumbreError, match=message):
        make()


def test_a_spot_lights_a_disk_of_its_angle() -> None:
    camera = lumbre.Orthographic((0, 0, 5), target=(0, 0, 0), up=(0, 1, 0), height=4)
    lamp = lumbre.SpotLight((0, 0, 2), intensity=4, angle=30, falloff=0)
    scene = lumbre.Scene(lumbre.Plane(material=lumbre.Diffuse(0.5)), camera=camera, lights=[lamp])
    seen = scene.render(spp=16, size=(40, 40)).array[..., 0]
    # Irradiance is intensity over the square of the distance.
    assert seen[20, 20] == pytest.approx(4 / 2**2 * 0.5 / np.pi, rel=0.02)
    radius = 2 * np.tan(np.radians(30))
    # At the edge, a pixel has half of the light of a cosine to the third power.
    lit = seen > 0.5 * np.cos(np.radians(30)) ** 3 * seen[20, 20]
    assert lit.mean() * 16 == pytest.approx(np.pi * radius**2, rel=0.05)


def test_mixtures_that_share_mixtures_are_compared_hashed_and_written_once() -> None:
    def nested(depth: int, last: lumbre.Material) -> lumbre.Material:
        for _ in range(depth):
            last = lumbre.Mix(last, last)
        return last

    # Each has 2^64 leaves.
    one, same, other = (nested(64, lumbre.Diffuse(share)) for share in (0.3, 0.3, 0.4))
    assert one is not same and one == same and hash(one) == hash(same)
    assert one != other and other != one and one != nested(63, lumbre.Diffuse(0.3)) and one != lumbre.Diffuse(0.3)
    text = repr(one)
    assert text.count("Diffuse(") == 2 and len(text) < 20_000
    assert text.startswith("Mix(normal_map=None, bump_map=None, first=Mix#1(") and "second=Mix#1, amount=0.5)" in text
    # What shares nothing is written as ever, and its parts may be equal without being the same.
    plain = lumbre.Mix(lumbre.Mix(amount=0.2), lumbre.Mix(amount=0.2))
    assert plain == lumbre.Mix(plain.first, plain.first) and "#" not in repr(plain)
    assert plain != lumbre.Mix(plain.first, lumbre.Mix(amount=0.3)) and plain != lumbre.Mix(plain.first, plain.first, 0.4)
    again = pickle.loads(pickle.dumps(one))
    assert again == one and hash(again) == hash(one)


def test_a_noise_that_is_not_reached_is_said() -> None:
    scene = lumbre.Scene([lumbre.Sphere()], lights=[lumbre.PointLight((3, -4, 5), 200)])
    with pytest.warns(UserWarning, match="not below the target 0.001: give more spp"):
        image = scene.render(20, (16, 12), noise=0.001, denoise=False)
    stats = image.stats
    assert stats["noise_target"] == 0.001 and stats["noise_target_met"] is False
    assert stats["noise"] > 0.001 and stats["noisy_pixels"] > 0
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        stats = scene.render(size=(16, 12), noise=0.2, min_spp=40, denoise=False).stats
    assert stats["noise_target_met"] is True and stats["spp"] >= 40 and stats["noisy_pixels"] == 0
    with pytest.raises(lumbre.LumbreError, match="min_spp is for a render to a noise"):
        scene.render(1, (8, 6), min_spp=3)
    assert scene.render(1, (8, 6)).stats["noise_target_met"] is None
