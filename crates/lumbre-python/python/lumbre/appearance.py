"""Materials, lights and cameras."""

from __future__ import annotations

import functools
import math
import os
import warnings
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from . import _lumbre
from ._arrays import Triple, array_of, positive, real, triple, wholes
from ._lumbre import LumbreError
from ._words import Described
from .sky import sun_direction

Colour = tuple[float, float, float]


def colour(name: str, value: float | str | Iterable[float]) -> Colour:
    """A colour: one number for grey, linear red, green and blue, or a name."""
    if isinstance(value, str):
        return _lumbre.named_colour(value)
    if isinstance(value, (int, float, np.integer, np.floating)):
        return float(value), float(value), float(value)
    return triple(name, value)


@dataclass(frozen=True, eq=False)
class Texture(metaclass=Described):
    """An image on a surface, by its texture coordinates.

    Parameters
    ----------
    image : (h, w), or (h, w, 1 to 4) array
        The first row is at the top, where v is 1. Of any kind of numbers; uint8 and uint16 stand for 0 to 1.
    encoding : "auto", "srgb" or "linear"
        How uint8 and uint16 are meant; "auto" takes them for sRGB where they are a colour, and for linear where they are a number or a
        normal. Floats are linear.
    wrap : "repeat", "clamp", "black" or "mirror"
        What is beyond the edges.
    filter : "nearest", "bilinear", "trilinear" or "ewa"
    scale, offset : pairs
        (u, v) times scale, plus offset, is where the image is looked up.

    Where a number is looked for in colours, it is their mean, or their alpha where that is not 1 everywhere.

    >>> checks = Texture(np.indices((4, 4)).sum(axis=0) % 2, scale=(3, 3), filter="nearest")
    >>> Diffuse(checks).reflectance.image.shape
    (4, 4)
    """

    image: npt.ArrayLike
    encoding: str = "auto"
    wrap: str = "repeat"
    filter: str = "bilinear"
    scale: tuple[float, float] = (1.0, 1.0)
    offset: tuple[float, float] = (0.0, 0.0)

    def __post_init__(self) -> None:
        object.__setattr__(self, "image", array_of("a texture", self.image))
        object.__setattr__(self, "_made", {})
        self._native(True)

    def _native(self, is_colour: bool) -> _lumbre.Texture:
        # Made once for each meaning, and shared by all that it is on.
        made: dict[bool, _lumbre.Texture] = self.__dict__["_made"]
        if is_colour not in made:
            made[is_colour] = self._new(is_colour)
        return made[is_colour]

    def __getstate__(self) -> dict[str, Any]:
        return _given(self)

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        self.__post_init__()

    def _new(self, is_colour: bool) -> _lumbre.Texture:
        texels = np.asarray(self.image)
        if self.encoding not in ("auto", "srgb", "linear"):
            raise LumbreError(f'encoding is unknown (found "{self.encoding}"; expected auto, srgb, linear)')
        is_whole = texels.dtype in (np.uint8, np.uint16)
        if texels.dtype.kind not in "fiub":
            raise LumbreError(f"a texture is of the wrong kind (found {texels.dtype}; expected real numbers)")
        if texels.ndim not in (2, 3):
            raise LumbreError(f"a texture has the wrong shape (found {texels.shape}; expected (h, w) or (h, w, 1 to 4))")
        if not is_whole:
            texels = texels.astype(np.float32, copy=False)
            if not np.isfinite(texels).all():
                raise LumbreError("a texture has numbers that are not finite")
        is_srgb = self.encoding == "srgb" or (self.encoding == "auto" and is_whole and is_colour)
        table = texels if texels.ndim == 3 else texels[..., None]
        return _lumbre.Texture(table, is_srgb, self.wrap, self.filter, self.scale, self.offset)


def _given(part: Any) -> dict[str, Any]:
    """What a part was made of, without what was made of it."""
    return {name: value for name, value in part.__dict__.items() if name not in ("_made", "_hash")}


def _textured(value: Any) -> Any:
    """Arrays of two and three axes as textures, all else as it is."""
    return Texture(value) if isinstance(value, np.ndarray) and value.ndim > 1 else value


def _colour_map(name: str, value: Any) -> _lumbre.Texture | Colour:
    return value._native(True) if isinstance(value, Texture) else colour(name, value)


def _number_map(name: str, value: Any) -> _lumbre.Texture | float:
    if isinstance(value, Texture):
        return value._native(False)
    try:
        return float(value)
    except (TypeError, ValueError) as error:
        raise LumbreError(f"{name} is no number (found {value!r}; expected a number, a Texture or an (h, w) array)") from error


ColourMap = float | str | Iterable[float] | Texture | npt.NDArray[Any]
NumberMap = float | Texture | npt.NDArray[Any]


@dataclass(frozen=True)
class Material(metaclass=Described):
    """The appearance of a surface: one of Diffuse, Metal, Glass, ThinGlass, Coated, Translucent, Hair, Principled and Mix.

    Where a material is expected, a colour stands for `Diffuse` of it.

    Parameters are numbers; colours are numbers, (r, g, b) in linear light, names such as "red", or "#e8e0d8" in
    sRGB. Each that is a colour, and each that may differ from place to place
    (said by its type), may be a `Texture` or an array of one, (h, w) or (h, w, 3). `normal_map` is an image of normals in tangent space,
    as in glTF, and `bump_map` one of heights. Wrong numbers raise `LumbreError` at once.
    """

    normal_map: Texture | npt.NDArray[Any] | None = field(default=None, kw_only=True)
    bump_map: Texture | npt.NDArray[Any] | None = field(default=None, kw_only=True)

    def __post_init__(self) -> None:
        for name, value in _given(self).items():
            object.__setattr__(self, name, _textured(value))
        # Made once, and shared by all that it is on, and by mixtures.
        object.__setattr__(self, "_made", self._new())

    def _native(self) -> _lumbre.Material:
        made: _lumbre.Material = self.__dict__["_made"]
        return made

    def __getstate__(self) -> dict[str, Any]:
        return _given(self)

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        self.__post_init__()

    def _new(self) -> _lumbre.Material:
        maps = [None if map is None else _number_map("a map", map) for map in (self.normal_map, self.bump_map)]
        if any(isinstance(map, float) for map in maps):
            raise LumbreError("a map is no image (expected a Texture or an array)")
        normals, heights = (map for map in maps if not isinstance(map, float))
        return self._kind().tilted(normals, heights)

    def _kind(self) -> _lumbre.Material:
        raise LumbreError("a material is one of Diffuse, Metal, Glass, ThinGlass, Coated, Translucent, Hair, Principled and Mix")


def material_of(value: Any) -> Material | None:
    """A material, or the matt one of a colour."""
    if value is None or isinstance(value, Material):
        return value
    is_texture = isinstance(value, Texture) or (isinstance(value, np.ndarray) and value.ndim > 1)
    is_colour = isinstance(value, (str, int, float, np.integer, np.floating, tuple, list, np.ndarray)) and not isinstance(value, bool)
    if is_texture or is_colour:
        return Diffuse(value)
    raise LumbreError(f"material is no material (found {value!r}; expected one, such as Diffuse(0.5), or a colour)")


@dataclass(frozen=True)
class Diffuse(Material):
    """Matt, with this linear reflectance in [0, 1], as a number or (r, g, b).

    >>> Diffuse((0.8, 0.3, 0.1)).reflectance
    (0.8, 0.3, 0.1)
    """

    reflectance: ColourMap = 0.5

    def _kind(self) -> _lumbre.Material:
        return _lumbre.Material.diffuse(_colour_map("reflectance", self.reflectance))


@dataclass(frozen=True)
class Metal(Material):
    """A metal by its reflectance at normal incidence; roughness from 0, a mirror, to 1.

    >>> Metal(0.9, roughness=0.1).roughness
    0.1
    """

    reflectance: ColourMap = 0.9
    roughness: NumberMap = 0.0

    def _kind(self) -> _lumbre.Material:
        return _lumbre.Material.metal(_colour_map("reflectance", self.reflectance), _number_map("roughness", self.roughness))


@dataclass(frozen=True)
class Glass(Material):
    """Clear glass of an index of refraction, smooth or rough: what a closed body is made of.

    >>> Glass(1.33).ior
    1.33
    """

    ior: float = 1.5
    roughness: NumberMap = 0.0

    def _kind(self) -> _lumbre.Material:
        return _lumbre.Material.glass(self.ior, _number_map("roughness", self.roughness))


@dataclass(frozen=True)
class ThinGlass(Material):
    """A clear pane without thickness: what a single surface is made of.

    >>> ThinGlass().ior
    1.5
    """

    ior: float = 1.5

    def _kind(self) -> _lumbre.Material:
        return _lumbre.Material.pane(self.ior)


@dataclass(frozen=True)
class Coated(Material):
    """Matt under a clear coat, as plastic and varnished wood; roughness is that of the coat.

    >>> Coated((0.1, 0.3, 0.6), roughness=0.1).ior
    1.5
    """

    reflectance: ColourMap = 0.5
    roughness: NumberMap = 0.0
    ior: float = 1.5

    def _kind(self) -> _lumbre.Material:
        reflectance, roughness = _colour_map("reflectance", self.reflectance), _number_map("roughness", self.roughness)
        return _lumbre.Material.coated(reflectance, roughness, self.ior)


@dataclass(frozen=True)
class Translucent(Material):
    """Matt on both sides, with light that comes through, as paper and leaves.

    >>> Translucent(0.4, transmittance=(0.2, 0.4, 0.1)).reflectance
    0.4
    """

    reflectance: ColourMap = 0.25
    transmittance: ColourMap = 0.25

    def _kind(self) -> _lumbre.Material:
        reflectance = _colour_map("reflectance", self.reflectance)
        return _lumbre.Material.translucent(reflectance, _colour_map("transmittance", self.transmittance))


@dataclass(frozen=True)
class Hair(Material):
    """Hair and fur, on `Curves`.

    `eumelanin` is the brown pigment (0.3 is blond, 1.3 brown, 8 black), `pheomelanin` the red one; `color`, if given, takes their place:
    the colour of a mass of such hair. Roughness along and around the fibre is in [0, 1]; `tilt` is that of its scales, in degrees.

    >>> Hair(eumelanin=0.3).ior
    1.55
    """

    eumelanin: float = 1.3
    pheomelanin: float = 0.0
    color: ColourMap | None = None
    roughness: NumberMap = 0.3
    azimuthal_roughness: NumberMap = 0.3
    tilt: float = 2.0
    ior: float = 1.55

    def _kind(self) -> _lumbre.Material:
        color = None if self.color is None else _colour_map("color", self.color)
        along = _number_map("roughness", self.roughness)
        around = _number_map("azimuthal_roughness", self.azimuthal_roughness)
        return _lumbre.Material.hair((self.eumelanin, self.pheomelanin), color, along, around, self.tilt, self.ior)


@dataclass(frozen=True)
class Principled(Material):
    """What most things are made of, by the parameters of glTF: all in [0, 1] but for `ior`, 1 or more, and `attenuation_distance`.

    Where it transmits, it is a thin pane, unless it has an `attenuation_distance`: then it is a body, in which light has
    `attenuation_color` left after that distance; `math.inf` is a clear one.

    >>> Principled((0.1, 0.2, 0.8), roughness=0.3).metallic
    0.0
    """

    base_color: ColourMap = 0.8
    metallic: NumberMap = 0.0
    roughness: NumberMap = 0.5
    transmission: NumberMap = 0.0
    clearcoat: NumberMap = 0.0
    ior: float = 1.5
    clearcoat_roughness: NumberMap = 0.0
    sheen_color: ColourMap = 0.0
    sheen_roughness: NumberMap = 0.0
    specular: NumberMap = 1.0
    specular_color: ColourMap = 1.0
    attenuation_color: float | Iterable[float] = 1.0
    attenuation_distance: float | None = None

    def _kind(self) -> _lumbre.Material:
        distance = self.attenuation_distance
        attenuation = None if distance is None else (colour("attenuation_color", self.attenuation_color), distance)
        return _lumbre.Material.principled(
            _colour_map("base_color", self.base_color),
            _number_map("metallic", self.metallic),
            _number_map("roughness", self.roughness),
            _number_map("transmission", self.transmission),
            _number_map("clearcoat", self.clearcoat),
            _number_map("clearcoat_roughness", self.clearcoat_roughness),
            _colour_map("sheen_color", self.sheen_color),
            _number_map("sheen_roughness", self.sheen_roughness),
            _number_map("specular", self.specular),
            _colour_map("specular_color", self.specular_color),
            self.ior,
            attenuation,
        )


@dataclass(frozen=True, eq=False, repr=False)
class Mix(Material):
    """One material or another from place to place: `amount` is the share of the second.

    A mixture of mixtures may share them. Then each is compared, hashed and written once: a shared one has a number where `repr` writes it
    first, and is that number from there on.

    >>> Mix(Diffuse(0.8), Metal(0.9), np.eye(2)).amount.image.shape
    (2, 2)
    """

    first: Material = Diffuse()
    second: Material = Metal()
    amount: NumberMap = 0.5

    def _kind(self) -> _lumbre.Material:
        return _lumbre.Material.mix(self.first._native(), self.second._native(), _number_map("amount", self.amount))

    def _own(self) -> tuple[Any, ...]:
        """What it is besides its two materials."""
        return self.normal_map, self.bump_map, self.amount

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Mix) or type(other) is not type(self):
            return NotImplemented
        # Pairs that are equal if all others are: each is in a class, by the identity of one of it (Hopcroft and Karp, "A linear algorithm
        # for testing equivalence of finite automata", 1971).
        classes: dict[int, int] = {}

        def of(material: Material) -> int:
            found = id(material)
            while (next := classes.get(found, found)) != found:
                classes[found] = classes.get(next, next)
                found = next
            return found

        pairs: list[tuple[Material, Material]] = [(self, other)]
        while pairs:
            a, b = pairs.pop()
            if (one := of(a)) == (two := of(b)):
                continue
            if not isinstance(a, Mix) or not isinstance(b, Mix) or type(a) is not type(b):
                if a != b:
                    return False
                continue
            if a._own() != b._own():
                return False
            classes[one] = two
            pairs += (a.first, b.first), (a.second, b.second)
        return True

    def __hash__(self) -> int:
        if "_hash" not in self.__dict__:
            object.__setattr__(self, "_hash", hash((self._own(), self.first, self.second)))
        value: int = self.__dict__["_hash"]
        return value

    def __repr__(self) -> str:
        # How often each mixture is used by those of this one.
        uses: dict[int, int] = {}
        left: list[Material] = [self]
        while left:
            material = left.pop()
            uses[id(material)] = uses.get(id(material), 0) + 1
            if isinstance(material, Mix) and uses[id(material)] == 1:
                left += material.first, material.second
        numbers: dict[int, int] = {}

        def written(material: Material) -> str:
            if not isinstance(material, Mix):
                return repr(material)
            if id(material) in numbers:
                return f"{type(material).__name__}#{numbers[id(material)]}"
            name = type(material).__name__
            if uses[id(material)] > 1:
                numbers[id(material)] = len(numbers) + 1
                name += f"#{len(numbers)}"
            maps = f"normal_map={material.normal_map!r}, bump_map={material.bump_map!r}"
            parts = f"first={written(material.first)}, second={written(material.second)}, amount={material.amount!r}"
            return f"{name}({maps}, {parts})"

        return written(self)


@dataclass(frozen=True)
class Medium(metaclass=Described):
    """What fills a shape, the same everywhere: haze, smoke, water, milk. Shapes take it as `medium=`; without a material their surface is
    not seen.

    Parameters
    ----------
    absorption, scattering : colours, coefficients per unit of length of the world
        Light that goes straight on over a distance d has exp(-(absorption + scattering) d) left.
    asymmetry : from -1, backwards, to 1, forwards
        Of the phase function of Henyey and Greenstein; 0 scatters all around alike.
    emission : colour, the radiance that it tends to where it is deep and does not scatter

    >>> Medium(scattering=0.2).asymmetry
    0.0
    """

    absorption: float | str | Iterable[float] = 0.0
    scattering: float | str | Iterable[float] = 1.0
    asymmetry: float = 0.0
    emission: float | str | Iterable[float] = 0.0

    def __post_init__(self) -> None:
        colours = [colour(name, getattr(self, name)) for name in ("absorption", "scattering", "emission")]
        object.__setattr__(self, "_made", _lumbre.Medium(colours[0], colours[1], self.asymmetry, colours[2]))

    @staticmethod
    def measured(name: str, units_per_mm: float = 1.0) -> Medium:
        """A measured medium, such as "Wholemilk" or "Marble", by the name that scene files have for it; its coefficients are per mm,
        which are `units_per_mm` units of the world.

        >>> Medium.measured("Skimmilk", units_per_mm=0.1).scattering[0].__round__(3)
        7.0
        """
        absorption, scattering = _lumbre.Medium.measured(name)
        per = 1 / positive("units_per_mm", units_per_mm)
        return Medium(tuple(per * x for x in absorption), tuple(per * x for x in scattering))

    def _native(self) -> _lumbre.Medium:
        made: _lumbre.Medium = self.__dict__["_made"]
        return made

    def __getstate__(self) -> dict[str, Any]:
        return _given(self)

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        self.__post_init__()


@dataclass(frozen=True)
class Light(metaclass=Described):
    """A light other than a shape: one of PointLight, SpotLight, DistantLight, SunLight, SkyLight and EnvironmentLight. Shapes with
    `emission` are lights, too; `AreaLight` makes such a rectangle."""

    def __post_init__(self) -> None:
        # Made once: what is made of an image takes its time, and pictures know by it that they are in the same light.
        object.__setattr__(self, "_made", self._new())

    def _native(self) -> _lumbre.Light:
        made: _lumbre.Light = self.__dict__["_made"]
        return made

    def __getstate__(self) -> dict[str, Any]:
        return _given(self)

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        self.__post_init__()

    def _new(self) -> _lumbre.Light:
        raise LumbreError("a light is one of PointLight, SpotLight, DistantLight, SunLight, SkyLight and EnvironmentLight")


@dataclass(frozen=True)
class PointLight(Light):
    """A point light of this radiant intensity.

    >>> PointLight((0, 0, 5), 100).intensity
    100
    """

    position: Iterable[float]
    intensity: float | str | Iterable[float] = 1.0

    def _new(self) -> _lumbre.Light:
        position = triple("position", self.position)
        return _lumbre.Light.point(position, colour("intensity", self.intensity))


@dataclass(frozen=True)
class SpotLight(Light):
    """A cone of light from `position` towards `target`: of this radiant intensity along its axis, `angle` degrees wide to each side, of
    which the outer `falloff` degrees fade out.

    >>> SpotLight((0, 0, 5), intensity=100, angle=20).falloff
    5.0
    """

    position: Iterable[float]
    target: Iterable[float] = (0.0, 0.0, 0.0)
    intensity: float | str | Iterable[float] = 1.0
    angle: float = 30.0
    falloff: float = 5.0

    def _new(self) -> _lumbre.Light:
        position, target = triple("position", self.position), triple("target", self.target)
        return _lumbre.Light.spot(position, target, colour("intensity", self.intensity), self.angle, self.falloff)


@dataclass(frozen=True)
class DistantLight(Light):
    """Parallel light, such as the sun's, from where `towards` points; irradiance on a surface that faces it.

    >>> DistantLight((0, 1, 1), 3).irradiance
    3
    """

    towards: Iterable[float]
    irradiance: float | str | Iterable[float] = 1.0

    def _new(self) -> _lumbre.Light:
        towards = triple("towards", self.towards)
        return _lumbre.Light.distant(towards, colour("irradiance", self.irradiance))


@dataclass(frozen=True)
class SunLight(Light):
    """The sun, a disc as wide as it is seen from the earth.

    Parameters
    ----------
    azimuth : degrees clockwise from north, which is y; x is east
    elevation : degrees above the horizon; below it the sun gives no light
    irradiance : that of a surface that faces it; by default what the air leaves of it, in the units of `SkyLight`
    turbidity : how hazy the air is, from 1 to 10
    angle : its diameter in degrees; 0 for parallel light, whose shadows are hard

    `solar_position` says where the sun stands at a time and a place.

    >>> SunLight(azimuth=180, elevation=45).towards[1] < 0
    True
    """

    azimuth: float = 180.0
    elevation: float = 45.0
    irradiance: float | str | Iterable[float] | None = None
    turbidity: float = 3.0
    angle: float = 0.533

    @property
    def towards(self) -> Triple:
        """The unit vector towards the sun."""
        return sun_direction(self.azimuth, self.elevation)

    def _new(self) -> _lumbre.Light:
        if self.elevation <= 0:
            return _lumbre.Light.distant(self.towards, (0.0, 0.0, 0.0))
        if self.irradiance is not None:
            irradiance = colour("irradiance", self.irradiance)
            if self.angle == 0:
                return _lumbre.Light.distant(self.towards, irradiance)
            return _lumbre.Light.disc(self.towards, self.angle, irradiance)
        return _lumbre.Light.sun(self.azimuth, self.elevation, self.turbidity, self.angle)


@dataclass(frozen=True, eq=False)
class EnvironmentLight(Light):
    """Light from all around: this radiance, or a factor on `image`, (h, 2h, 3), by longitude and latitude with `up` at its top; where that
    is z, x is in its middle, and y three quarters of its width to the right.

    >>> EnvironmentLight(0.5).radiance
    0.5
    """

    radiance: float | str | Iterable[float] = 1.0
    image: npt.ArrayLike | None = None
    up: Iterable[float] = (0.0, 0.0, 1.0)

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.image is not None:
            is_finite = np.isfinite(array_of("image", self.image)).all(axis=-1)
            if not is_finite.all():
                y, x = np.argwhere(~is_finite)[0]
                warnings.warn(f"texel ({x}, {y}) of an environment is not finite, and taken for black", stacklevel=4)

    def _new(self) -> _lumbre.Light:
        image = None if self.image is None else array_of("image", self.image).astype(np.float32, copy=False)
        if image is not None and image.ndim != 3:
            raise LumbreError(f"image has the wrong shape (found {image.shape}; expected (h, 2h, 3))")
        return _lumbre.Light.environment(colour("radiance", self.radiance), image, triple("up", self.up))


@dataclass(frozen=True)
class SkyLight(Light):
    """A clear sky without its sun, whose place is as of `SunLight`: L. Hosek, A. Wilkie, "An Analytic Model for Full Spectral Sky-Dome
    Radiance", 2012. Its units are such that a white surface shows 1 where 100,000 lux light it.

    Parameters
    ----------
    azimuth, elevation : of the sun, in degrees; the elevation is from 0 to 90
    radiance : that of the zenith, in place of the model's; a colour tints the sky
    turbidity : how hazy the air is, from 1 to 10; a clear day has 2 to 4
    albedo : the reflectance of the ground, which lights the sky and is what is seen below the horizon

    >>> SkyLight(elevation=30).turbidity
    3.0
    """

    azimuth: float = 180.0
    elevation: float = 45.0
    radiance: float | str | Iterable[float] | None = None
    turbidity: float = 3.0
    albedo: float = 0.3

    def _map(self) -> npt.NDArray[np.float32]:
        pixels, zenith = _lumbre.clear_sky(self.azimuth, self.elevation, self.turbidity, self.albedo)
        if self.radiance is not None:
            pixels = pixels * (np.array(colour("radiance", self.radiance), dtype=np.float32) / np.float32(zenith))
        return pixels

    def _new(self) -> _lumbre.Light:
        return _lumbre.Light.environment((1.0, 1.0, 1.0), self._map(), (0.0, 0.0, 1.0))


@functools.lru_cache(maxsize=4)
def _map_of(path: str, modified: int, size: int) -> _lumbre.Environment:
    pixels, _ = _lumbre.read_image(path)
    return _lumbre.Environment(pixels)


def environment(value: Any) -> str | _lumbre.Light | _lumbre.Environment:
    """Light from all around, as `Scene.render` takes it."""
    if isinstance(value, EnvironmentLight | SkyLight):
        return value._native()
    if isinstance(value, str) and (value in ("studio", "none") or value.startswith("sky:")):
        return value
    if isinstance(value, (str, os.PathLike)):
        path = os.path.abspath(os.fspath(value))
        state = os.stat(path)
        return _map_of(path, state.st_mtime_ns, state.st_size)
    if isinstance(value, np.ndarray) and value.ndim == 3:
        return _lumbre.Environment(array_of("env", value).astype(np.float32, copy=False))
    if isinstance(value, (int, float, tuple, list, np.ndarray)) and not isinstance(value, bool):
        return EnvironmentLight(value)._native()
    raise LumbreError(
        f"env is no light from all around (found {value!r}; expected a file, an (h, 2h, 3) array, an EnvironmentLight, a SkyLight, "
        'a radiance, "studio", "sky:TIME,LATITUDE,LONGITUDE" or "none")'
    )


@dataclass(frozen=True, eq=False)
class Camera(metaclass=Described):
    """Where a picture is taken from: one of Perspective, Orthographic, Panorama and Pinhole."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "_made", self._new())

    def _native(self) -> _lumbre.Camera:
        made: _lumbre.Camera = self.__dict__["_made"]
        return made

    def __getstate__(self) -> dict[str, Any]:
        return _given(self)

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        self.__post_init__()

    def _new(self) -> _lumbre.Camera:
        raise LumbreError("a camera is one of Perspective, Orthographic, Panorama and Pinhole")

    def _size(self) -> tuple[int, int] | None:
        """Width and height of its pictures, where it knows them."""
        return None

    def rays(self, width: int | None = None, height: int | None = None) -> tuple[npt.NDArray[Any], npt.NDArray[Any]]:
        """The rays through the centres of a picture's pixels, row by row from the top: origins and unit directions, (height, width, 3).
        A `Pinhole` knows its width and height.

        >>> origins, directions = Perspective((0, -5, 0), fov=40).rays(4, 3)
        >>> directions.shape
        (3, 4, 3)
        """
        own = self._size()
        if width is None or height is None:
            if own is None or width is not height:
                raise LumbreError("rays needs width and height in pixels")
            width, height = own
        return self._native().rays(width, height)


@dataclass(frozen=True)
class _Looking(Camera):
    """A camera by what it looks at."""

    eye: Iterable[float]
    target: Iterable[float] = (0.0, 0.0, 0.0)
    up: Iterable[float] = (0.0, 0.0, 1.0)

    def _view(self) -> tuple[Triple, Triple, Triple]:
        return triple("eye", self.eye), triple("target", self.target), triple("up", self.up)


@dataclass(frozen=True)
class Perspective(_Looking):
    """A pinhole, or a thin lens, at `eye`: it sees `target` in the middle of the picture, with `up` upwards. `fov` is the full angle in
    degrees along the shorter side of the picture; `lens_radius` above 0 blurs what is nearer or farther than `target`.

    Raises `LumbreError` where eye and target coincide, and where `up` is parallel to the view.

    >>> Perspective((0, -5, 1), fov=40).fov
    40
    """

    fov: float = 40.0
    lens_radius: float = 0.0

    def _new(self) -> _lumbre.Camera:
        return _lumbre.Camera.perspective(*self._view(), self.fov, self.lens_radius)

    @staticmethod
    def from_intrinsics(
        fx: float,
        fy: float,
        cx: float,
        cy: float,
        size: tuple[int, int],
        pose: npt.ArrayLike,
        axes: str = "opencv",
    ) -> Pinhole:
        """A calibrated pinhole, by the numbers of data sets: see `Pinhole`.

        >>> camera = Perspective.from_intrinsics(500, 500, 320, 240, (640, 480), np.eye(4))
        >>> camera.rays()[1][240, 320].round(3).tolist()
        [0.001, 0.001, 1.0]
        """
        return Pinhole(fx, fy, cx, cy, size, pose, axes)


@dataclass(frozen=True, eq=False)
class Pinhole(Camera):
    """A calibrated pinhole: how data sets give cameras.

    Parameters
    ----------
    fx, fy : focal lengths in pixels, above 0
    cx, cy : the principal point in pixels from the picture's upper left corner
        In the middle of the picture it is (width / 2, height / 2), as COLMAP counts. Where calibrations count from the middle of the first
        pixel, as OpenCV's do, add 0.5 to both.
    size : (width, height) in pixels
        The size of its pictures, where none is asked for; in another size the same is seen.
    pose : (4, 4) array
        World from camera: its last column is the camera's place. For extrinsics, which are camera from world, give `np.linalg.inv` of them.
    axes : "opencv" or "opengl"
        What the axes of the camera are: x to the right, y down and z forwards (OpenCV, COLMAP), or x to the right, y upwards and z
        backwards (OpenGL, Blender, NeRF).

    Lens distortion is not taken into account: use the numbers of undistorted pictures. Raises `LumbreError` where the pose is no rigid
    motion.

    >>> pose = np.eye(4)
    >>> pose[:3, 3] = [0, 0, -5]
    >>> Pinhole(600, 600, 320, 240, size=(640, 480), pose=pose).rays()[0][0, 0].tolist()
    [0.0, 0.0, -5.0]
    """

    fx: float
    fy: float
    cx: float
    cy: float
    size: tuple[int, int]
    pose: npt.ArrayLike
    axes: str = "opencv"

    def _size(self) -> tuple[int, int] | None:
        width, height = wholes("size", self.size, "width, height", 1)
        return width, height

    def _new(self) -> _lumbre.Camera:
        width, height = wholes("size", self.size, "width, height", 1)
        fx, fy = (positive(name, getattr(self, name), "pixels, above 0") for name in ("fx", "fy"))
        cx, cy = (float(value) for value in (self.cx, self.cy))
        if not (math.isfinite(cx) and math.isfinite(cy)):
            raise LumbreError(f"cx, cy are not finite (found {self.cx!r}, {self.cy!r}; expected pixels)")
        pose = rigid("pose", self.pose)
        if self.axes not in ("opencv", "opengl"):
            raise LumbreError(f"axes are unknown (found {self.axes!r}; expected opencv, opengl)")
        if self.axes == "opencv":
            pose = pose @ np.diag([1.0, -1.0, -1.0, 1.0])
        window = (-cx / fx, (width - cx) / fx, (cy - height) / fy, cy / fy)
        return _lumbre.Camera.pinhole(window, pose.tolist())


def rigid(name: str, value: npt.ArrayLike) -> npt.NDArray[np.float64]:
    """A (4, 4) matrix that turns and moves, and no more; (3, 4) is taken, too."""
    matrix = real(array_of(name, value)).astype(np.float64, copy=False)
    if matrix.shape == (3, 4):
        matrix = np.vstack([matrix, [0.0, 0.0, 0.0, 1.0]])
    if matrix.shape != (4, 4):
        raise LumbreError(f"{name} has the wrong shape (found {matrix.shape}; expected (4, 4))")
    if not np.isfinite(matrix).all() or not np.allclose(matrix[3], [0, 0, 0, 1], atol=1e-6):
        hint = "; it seems transposed" if np.allclose(matrix[:, 3], [0, 0, 0, 1], atol=1e-6) else ""
        raise LumbreError(f"{name} is no pose (found the last row {matrix[3].tolist()}; expected [0, 0, 0, 1]{hint})")
    turn = matrix[:3, :3]
    if not np.allclose(turn.T @ turn, np.eye(3), atol=1e-3):
        lengths = np.linalg.norm(turn, axis=0).round(6).tolist()
        raise LumbreError(f"{name} is no rigid motion (found columns of lengths {lengths}; expected three unit columns at right angles)")
    if np.linalg.det(turn) < 0:
        raise LumbreError(f"{name} is a mirror (found determinant -1; expected a rotation: are its axes those of axes=?)")
    return matrix


@dataclass(frozen=True)
class Orthographic(_Looking):
    """No perspective, as `Perspective` but for that: the shorter side of the picture is `height` long in the world.

    >>> Orthographic((0, -5, 1), height=3).height
    3
    """

    height: float = 1.0

    def _new(self) -> _lumbre.Camera:
        return _lumbre.Camera.orthographic(*self._view(), positive("height", self.height, "a length above 0"))


@dataclass(frozen=True)
class Panorama(_Looking):
    """All directions at once, by longitude and latitude, with `target` in the middle and `up` at the top.

    >>> Panorama((0, 0, 1), target=(0, 5, 1)).target
    (0, 5, 1)
    """

    def _new(self) -> _lumbre.Camera:
        return _lumbre.Camera.panorama(*self._view())
