"""Materials, lights and cameras."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from . import _lumbre
from ._arrays import Triple, triple
from ._lumbre import LumbreError

Colour = tuple[float, float, float]


def colour(name: str, value: float | Iterable[float]) -> Colour:
    """A colour: one number for grey, or linear red, green and blue."""
    if isinstance(value, (int, float)):
        return float(value), float(value), float(value)
    return triple(name, value)


@dataclass(frozen=True)
class Material:
    """The appearance of a surface: one of Diffuse, Metal, Glass and Principled. Wrong numbers raise `LumbreError` at once."""

    def __post_init__(self) -> None:
        self._native()

    def _native(self) -> _lumbre.Material:
        raise LumbreError("a material is one of Diffuse, Metal, Glass and Principled")


@dataclass(frozen=True)
class Diffuse(Material):
    """Matt, with this linear reflectance in [0, 1], as a number or (r, g, b).

    >>> Diffuse((0.8, 0.3, 0.1)).reflectance
    (0.8, 0.3, 0.1)
    """

    reflectance: float | Iterable[float] = 0.5

    def _native(self) -> _lumbre.Material:
        return _lumbre.Material.diffuse(colour("reflectance", self.reflectance))


@dataclass(frozen=True)
class Metal(Material):
    """A metal by its reflectance at normal incidence; roughness from 0, a mirror, to 1.

    >>> Metal(0.9, roughness=0.1).roughness
    0.1
    """

    reflectance: float | Iterable[float] = 0.9
    roughness: float = 0.0

    def _native(self) -> _lumbre.Material:
        return _lumbre.Material.metal(colour("reflectance", self.reflectance), self.roughness)


@dataclass(frozen=True)
class Glass(Material):
    """Smooth, clear glass of an index of refraction.

    >>> Glass(1.33).ior
    1.33
    """

    ior: float = 1.5

    def _native(self) -> _lumbre.Material:
        return _lumbre.Material.glass(self.ior)


@dataclass(frozen=True)
class Principled(Material):
    """What most things are made of, by the parameters of glTF: all in [0, 1] but for `ior`, 1 or more.

    >>> Principled((0.1, 0.2, 0.8), roughness=0.3).metallic
    0.0
    """

    base_color: float | Iterable[float] = 0.8
    metallic: float = 0.0
    roughness: float = 0.5
    transmission: float = 0.0
    clearcoat: float = 0.0
    ior: float = 1.5

    def _native(self) -> _lumbre.Material:
        return _lumbre.Material.principled(
            colour("base_color", self.base_color),
            self.metallic,
            self.roughness,
            self.transmission,
            self.clearcoat,
            self.ior,
        )


@dataclass(frozen=True)
class Light:
    """A light other than a shape: one of PointLight, DistantLight and EnvironmentLight."""

    def __post_init__(self) -> None:
        self._native()

    def _native(self) -> _lumbre.Light:
        raise LumbreError("a light is one of PointLight, DistantLight and EnvironmentLight")


@dataclass(frozen=True)
class PointLight(Light):
    """A point light of this radiant intensity.

    >>> PointLight((0, 0, 5), 100).intensity
    100
    """

    position: Iterable[float]
    intensity: float | Iterable[float] = 1.0

    def _native(self) -> _lumbre.Light:
        position = triple("position", self.position)
        return _lumbre.Light.point(position, colour("intensity", self.intensity))


@dataclass(frozen=True)
class DistantLight(Light):
    """Parallel light, such as the sun's, from where `towards` points; irradiance on a surface that faces it.

    >>> DistantLight((0, 1, 1), 3).irradiance
    3
    """

    towards: Iterable[float]
    irradiance: float | Iterable[float] = 1.0

    def _native(self) -> _lumbre.Light:
        towards = triple("towards", self.towards)
        return _lumbre.Light.distant(towards, colour("irradiance", self.irradiance))


@dataclass(frozen=True, eq=False)
class EnvironmentLight(Light):
    """Light from all around: this radiance, or a factor on `image`, (h, 2h, 3), by longitude and latitude with `up` at its top.

    >>> EnvironmentLight(0.5).radiance
    0.5
    """

    radiance: float | Iterable[float] = 1.0
    image: npt.ArrayLike | None = None
    up: Iterable[float] = (0.0, 0.0, 1.0)

    def _native(self) -> _lumbre.Light:
        image = None if self.image is None else np.asarray(self.image, dtype=np.float32)
        if image is not None and image.ndim != 3:
            raise LumbreError(f"image has the wrong shape (found {image.shape}; expected (h, 2h, 3))")
        return _lumbre.Light.environment(colour("radiance", self.radiance), image, triple("up", self.up))


@dataclass(frozen=True)
class Camera:
    """Where a picture is taken from: one of Perspective, Orthographic and Panorama.

    `eye` sees `target` in the middle of the picture, with `up` upwards. Raises `LumbreError` where these make no view.
    """

    eye: Iterable[float]
    target: Iterable[float] = (0.0, 0.0, 0.0)
    up: Iterable[float] = (0.0, 0.0, 1.0)

    def __post_init__(self) -> None:
        self._native()

    def _view(self) -> tuple[Triple, Triple, Triple]:
        return triple("eye", self.eye), triple("target", self.target), triple("up", self.up)

    def _native(self) -> _lumbre.Camera:
        raise LumbreError("a camera is one of Perspective, Orthographic and Panorama")

    def rays(self, width: int, height: int) -> tuple[npt.NDArray[Any], npt.NDArray[Any]]:
        """The rays through the centres of a picture's pixels, row by row from the top: origins and unit directions, (height, width, 3).

        >>> origins, directions = Perspective((0, -5, 0), fov=40).rays(4, 3)
        >>> directions.shape
        (3, 4, 3)
        """
        return self._native().rays(width, height)


@dataclass(frozen=True)
class Perspective(Camera):
    """A pinhole, or a thin lens; `fov` is the full angle in degrees along the shorter side of the picture.

    >>> Perspective((0, -5, 1), fov=40).fov
    40
    """

    fov: float = 40.0
    lens_radius: float = 0.0

    def _native(self) -> _lumbre.Camera:
        return _lumbre.Camera.perspective(*self._view(), self.fov, self.lens_radius)


@dataclass(frozen=True)
class Orthographic(Camera):
    """No perspective: the shorter side of the picture is `height` long in the world.

    >>> Orthographic((0, -5, 1), height=3).height
    3
    """

    height: float = 1.0

    def _native(self) -> _lumbre.Camera:
        return _lumbre.Camera.orthographic(*self._view(), self.height)


@dataclass(frozen=True)
class Panorama(Camera):
    """All directions at once, by longitude and latitude.

    >>> Panorama((0, 0, 1), target=(0, 5, 1)).target
    (0, 5, 1)
    """

    def _native(self) -> _lumbre.Camera:
        return _lumbre.Camera.panorama(*self._view())
