"""Curves through points, and hair on them."""

import numpy as np
import pytest

import lumbre


def test_a_curve_goes_through_its_points_and_is_as_wide_as_it_says() -> None:
    points = np.array([[[2.0, 0, 0], [2, 0, 1], [2, 0, 2], [2, 0, 3]], [[5.0, 0, 0], [5, 0, 1], [5, 0, 2], [5, 0, 3]]])
    widths = np.array([[0.5] * 4, [0.1, 0.2, 0.3, 0.4]])
    scene = lumbre.Scene([lumbre.Curves(points, widths)])
    x = np.array([2.0, 2.24, 2.26, 5.0, 5.09, 5.11])
    origins = np.stack([x, np.full(6, -4.0), np.full(6, 1.0)], axis=1)
    hits = scene.cast(origins, np.tile([0.0, 1.0, 0.0], (6, 1)))
    assert hits.hit.tolist() == [True, True, False, True, True, False]
    assert np.allclose(hits.t[hits.hit], 4.0)
    assert (hits.shape[hits.hit] == 0).all()
    later = scene.cast([[5.0, -4.0, 2.5]], [[0.0, 1.0, 0.0]])
    assert later.prim.tolist() == [5]


def test_what_is_no_curve_is_refused() -> None:
    line = [[0.0, 0, 0], [0, 0, 1]]
    with pytest.raises(lumbre.LumbreError, match="one for each point"):
        lumbre.Curves([line], [[0.1]])
    with pytest.raises(lumbre.LumbreError, match="curve 1: width"):
        lumbre.Curves([line, line], [[0.1, 0.1], [0.1, -1.0]])
    with pytest.raises(lumbre.LumbreError, match="two points or more"):
        lumbre.Curves([line[:1]], 0.1)
    with pytest.raises(lumbre.LumbreError, match="kind"):
        lumbre.Curves([line], 0.1, kind="round")
    with pytest.raises(lumbre.LumbreError, match="melanin"):
        lumbre.Hair(eumelanin=-1)


def test_dark_hair_is_darker_than_blond_hair() -> None:
    random = np.random.default_rng(3)
    roots = random.uniform(-1, 1, (200, 2))
    points = np.zeros((200, 4, 3))
    points[:, :, 2] = [0, 0.4, 0.7, 1.0]
    points[:, :, :2] = roots[:, None]

    def mean(material: lumbre.Hair) -> float:
        hair = lumbre.Curves(points, 0.05, material=material)
        camera = lumbre.Perspective((0, -5, 2), (0, 0, 0.5), fov=30)
        picture = lumbre.Scene([hair], lights=[lumbre.EnvironmentLight(1.0)], camera=camera).render(size=(32, 32), spp=8)
        return float(np.mean(picture.array))

    assert mean(lumbre.Hair(eumelanin=8)) < 0.9 * mean(lumbre.Hair(color=(0.9, 0.8, 0.6)))
