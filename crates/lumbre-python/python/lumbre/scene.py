"""Scenes: opened from files or built from shapes, queried with rays and points, rendered."""

from __future__ import annotations

import hashlib
import math
import os
import pickle
import sys
import warnings
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from . import _lumbre
from ._arrays import Array, array_of, fits, flag, positive, rays, rows, triple, whole, wholes
from ._lumbre import LumbreError
from ._words import Described, answers_names, no_attribute
from .appearance import Camera, Light, colour, environment
from .explanation import Explanation
from .geometry import Instances, Mesh, Shape, is_trimesh
from .image import Image
from .viewing import Viewer

FIELDS = ("t", "point", "normal", "uv", "front", "shape", "prim", "instance")
"""The fields of a hit, in the order of the program's own columns."""

_WIDTHS = {"point": 3, "normal": 3, "uv": 2}
_KINDS: dict[str, type[Any]] = {"front": np.bool_, "shape": np.int32, "prim": np.int32, "instance": np.int32}
_ndarray = np.ndarray
_NEAREST = ("distance", "point", "shape", "prim", "instance")

# What fields of hits are called elsewhere.
_OTHER_WORDS = {
    "normals": "normal",
    "points": "point",
    "position": "point",
    "positions": "point",
    "location": "point",
    "locations": "point",
    "distance": "t",
    "distances": "t",
    "depth": "t",
    "t_hit": "t",
    "uvs": "uv",
    "face": "prim",
    "faces": "prim",
    "triangle": "prim",
    "triangles": "prim",
    "primitive": "prim",
    "primitive_ids": "prim",
    "prims": "prim",
    "shapes": "shape",
    "geometry_ids": "shape",
    "instances": "instance",
    "hits": "hit",
    "is_hit": "hit",
    "mask": "hit",
}

Progress = Callable[[int, "int | None", float], object]


class Hits:
    """The closest hits of N rays, one array per field; fields that were not requested raise `AttributeError`.

    Attributes
    ----------
    t : (N,)
        Where along the ray, in units of the direction's length; inf for a miss.
    point : (N, 3)
        The place, on the surface; nan for a miss.
    normal : (N, 3)
        The geometric normal: unit, outward, not turned towards the ray; nan for a miss.
    uv : (N, 2)
        Surface parameters, or texture coordinates where a mesh has them; nan for a miss.
    front : (N,) of bool
        Whether the ray met the outer side.
    shape, prim, instance : (N,) of int32
        The shape by its position in the scene or its file, the triangle of a mesh (0 for other shapes), and the outermost instance;
        -1 where there is none.

    >>> from lumbre import Scene, Sphere
    >>> hits = Scene([Sphere()]).cast([[0.0, 0.0, -3.0], [0.0, 5.0, -3.0]], [0.0, 0.0, 1.0], fields=("t", "shape"))
    >>> hits.t.tolist(), hits.hit.tolist(), hits.shape.tolist()
    ([2.0, inf], [True, False], [0, -1])
    """

    t: Array
    point: Array
    normal: Array
    uv: Array
    front: Array
    shape: Array
    prim: Array
    instance: Array

    def __init__(self, columns: dict[str, Array]) -> None:
        # The columns are the attributes: this is the fastest way.
        self.__dict__ = columns

    def __getattr__(self, name: str) -> Array:
        if name in FIELDS:
            raise AttributeError(f"these hits have no {name} (cast with it among the fields)")
        raise no_attribute(self, name, {word: f"it is {ours}" for word, ours in _OTHER_WORDS.items()})

    @property
    def hit(self) -> npt.NDArray[np.bool_]:
        """Whether each ray hit anything, (N,)."""
        if "t" in self.__dict__:
            return np.isfinite(self.t)
        for name in ("shape", "prim"):
            if name in self.__dict__:
                return np.asarray(self.__dict__[name] >= 0)
        raise AttributeError("hit needs t, shape or prim among the fields")

    @property
    def fields(self) -> tuple[str, ...]:
        """The names of what was asked for."""
        return tuple(name for name in FIELDS if name in self.__dict__)

    def __len__(self) -> int:
        return next((len(column) for column in self.__dict__.values()), 0)

    def __repr__(self) -> str:
        return f"{type(self).__name__}({len(self)} rays: {', '.join(self.fields)})"


class AllHits(Hits):
    """Every hit of N rays by ascending t: those of ray i are `offsets[i]:offsets[i + 1]` of every other array.

    >>> from lumbre import Scene, Sphere
    >>> every = Scene([Sphere()]).cast_all([[0.0, 0.0, -3.0]], [[0.0, 0.0, 1.0]])
    >>> every.offsets.tolist(), every.t.tolist(), every.ray.tolist()
    ([0, 2], [2.0, 4.0], [0, 0])
    """

    offsets: Array

    def __len__(self) -> int:
        return len(self.t)

    def __repr__(self) -> str:
        return f"AllHits({len(self)} hits of {len(self.offsets) - 1} rays)"

    @property
    def ray(self) -> npt.NDArray[np.int64]:
        """The ray of each hit."""
        return np.repeat(np.arange(len(self.offsets) - 1), np.diff(self.offsets))


class Nearest:
    """The nearest points of all surfaces to N points.

    Attributes
    ----------
    distance : (N,)
        Never negative; inf where there is nothing within the distance asked for, and nan where the answer is not known.
    point : (N, 3)
        The place; nan where there is none.
    shape, prim, instance : (N,) of int32
        As those of `Hits`.
    """

    __slots__ = _NEAREST

    distance: Array
    point: Array
    shape: Array
    prim: Array
    instance: Array

    def __init__(self, columns: Mapping[str, Array]) -> None:
        for name, column in columns.items():
            setattr(self, name, column)

    def __len__(self) -> int:
        return len(self.distance)

    def __repr__(self) -> str:
        return f"Nearest({len(self)} points)"


@dataclass(frozen=True, eq=False, repr=False)
class SceneMesh(metaclass=Described):
    """A mesh of a scene in one of its places: arrays in world space, made when they are asked for, of `Scene.meshes`.

    Attributes
    ----------
    shape, instance : int
        As of `Hits`: the position of the shape in its scene, and the outermost instance, -1 where it is in none.
    vertices : (V, 3) float64
    faces : (F, 3) int64
        Counter-clockwise from the front, in the order of `Hits.prim`; a quad is two triangles, after the original triangles.
    normals : (V, 3) float64, or None
        Unit vectors for shading.
    uvs : (V, 2) float64, or None
        Texture coordinates.
    """

    shape: int
    instance: int
    _native: _lumbre.PlacedMesh

    @cached_property
    def vertices(self) -> npt.NDArray[np.float64]:
        """Places in the world, (V, 3)."""
        return self._native.vertices()

    @cached_property
    def faces(self) -> npt.NDArray[np.int64]:
        """Vertex numbers of triangles, (F, 3)."""
        return self._native.faces()

    @cached_property
    def normals(self) -> npt.NDArray[np.float64] | None:
        """Shading normals, (V, 3); None where it has none."""
        return self._native.normals()

    @cached_property
    def uvs(self) -> npt.NDArray[np.float64] | None:
        """Texture coordinates, (V, 2); None where it has none."""
        return self._native.uvs()

    def __getattr__(self, name: str) -> Any:
        raise no_attribute(self, name, {"uv": "it is uvs", "triangles": "it is faces"})

    def __repr__(self) -> str:
        where = "" if self.instance < 0 else f" in instance {self.instance}"
        return f"<lumbre.SceneMesh of shape {self.shape}{where}>"


class Scene:
    """Shapes with a camera and lights, ready for ray queries and pictures.

    Parameters
    ----------
    shapes : shapes, `Instances`, other scenes, and meshes of trimesh
        The contents: `[Sphere(), other_scene, mesh]`. Other scenes bring their lights and cameras, too. `Hits.shape` is the position among
        all shapes, in this order; shapes of instances come after the other shapes between two scenes.
    camera : Camera or list of them, optional
        The first is the default. Without any: that of the first scene with one, else one that frames everything.
    lights : list of lights, optional
        By default studio light, unless a shape emits. With neither camera nor light, everything also stands on its shadow in pictures.
    up : triple, optional
        The up direction of the default camera and light; by default that of the first scene among the shapes, else z.

    A scene does not change. It may be used from many threads at once, and is pickled by what it was made of. Queries release the
    interpreter's lock, use every core (or RAYON_NUM_THREADS) and end on Ctrl-C.

    >>> import lumbre
    >>> scene = lumbre.Scene([lumbre.Torus(major=1, minor=0.25), lumbre.Plane(point=(0, 0, -1))])
    >>> int(scene.count([[1.0, 0.0, 5.0]], [[0.0, 0.0, -1.0]])[0])
    3
    """

    @answers_names
    def __init__(
        self,
        shapes: Any,
        *,
        camera: Camera | Sequence[Camera] | None = None,
        lights: Iterable[Light | Shape] | Light = (),
        up: Iterable[float] | None = None,
    ) -> None:
        is_one = isinstance(shapes, (Shape, Instances, Scene)) or is_trimesh(shapes)
        parts = [Mesh(part) if is_trimesh(part) else part for part in ([shapes] if is_one else list(shapes))]
        cameras = [] if camera is None else [camera] if isinstance(camera, Camera) else list(camera)
        given = [lights] if isinstance(lights, (Light, Shape)) else list(lights)
        # Shapes that emit are lights, too.
        parts += [light for light in given if isinstance(light, Shape) and light._light() is not None]
        lamps: list[Any] = [light for light in given if not (isinstance(light, Shape) and light._light() is not None)]
        kinds = ((parts, (Shape, Instances, Scene), "shape"), (cameras, Camera, "camera"), (lamps, Light, "light"))
        for what, kind, name in kinds:
            for part in what:
                if not isinstance(part, kind):
                    raise LumbreError(f"this is no {name}: {part!r}")
        has_scenes = any(isinstance(part, Scene) for part in parts)
        upwards = triple("up", up) if up is not None else None if has_scenes else (0.0, 0.0, 1.0)
        source: dict[str, Any] = {"shapes": parts, "camera": cameras, "lights": lamps, "up": upwards}
        self._source = source
        self._warnings: tuple[str, ...] = sum((part.warnings for part in parts if isinstance(part, Scene)), ())
        self._native: _lumbre.Scene = _lumbre.Scene.build(
            [part._native if isinstance(part, Scene) else part._native() for part in parts],
            [camera._native() for camera in cameras],
            [light._native() for light in lamps],
            upwards,
            [("scene", _hash(source))],
        )

    def __getattr__(self, name: str) -> Any:
        raise no_attribute(self, name, _HINTS)

    @property
    def warnings(self) -> tuple[str, ...]:
        """What was odd about the file, a line each, with its place."""
        return self._warnings

    @property
    def info(self) -> dict[str, Any]:
        """Counts of shapes, materials and lights by type, triangles, instances, cameras, bounds, memory_bytes, is_dark."""
        return self._native.info()

    @property
    def bounds(self) -> npt.NDArray[np.float64] | None:
        """The lowest and the highest corner of everything finite, (2, 3); None where nothing is."""
        bounds = self.info["bounds"]
        return None if bounds is None else np.array(bounds)

    @property
    def meshes(self) -> list[SceneMesh]:
        """The meshes as arrays in world space, those of instances once for each place; meshes in CSG are not among them.

        >>> import lumbre
        >>> mesh = lumbre.Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]], transform=lumbre.translate(0, 0, 5))
        >>> lumbre.Scene([lumbre.Sphere(), mesh]).meshes[0].vertices.tolist()
        [[0.0, 0.0, 5.0], [1.0, 0.0, 5.0], [0.0, 1.0, 5.0]]
        """

        def of(native: _lumbre.PlacedMesh) -> SceneMesh:
            shape, instance = native.place()
            return SceneMesh(shape, -1 if instance is None else instance, native)

        return [of(native) for native in self._native.meshes()]

    def cast(
        self,
        origins: npt.ArrayLike,
        directions: npt.ArrayLike,
        tmin: npt.ArrayLike = 0.0,
        tmax: npt.ArrayLike = np.inf,
        *,
        fields: Sequence[str] = FIELDS,
        out: Mapping[str, Array] | None = None,
    ) -> Hits:
        """The closest hit of every ray.

        Parameters
        ----------
        origins, directions : (N, 3) or (3,) arrays
            One triple is for all rays. Any strides and order, read where they lie. Answers are in double precision, or in single where
            both arrays are float32 (then computed in double precision, and rounded once).
        tmin, tmax : number or (N,)
            The range of t that counts, its ends included, in units of the direction's length, which need not be 1.
        fields : names
            What to compute: fewer are faster. t, shape, prim and instance cost least.
        out : arrays by name, optional
            Where to write these fields (then `fields` is not looked at): C-contiguous, of N rows, of the rays' precision, or bool for
            front and int32 for shape, prim and instance. Memory-mapped arrays make memory constant for any number of rays.

        Raises `LumbreError` for wrong shapes and kinds. A ray with a nan, or a zero direction, misses.

        >>> import lumbre
        >>> hits = lumbre.Scene([lumbre.Sphere(radius=2)]).cast([[0.0, 0.0, 5.0]], [[0.0, 0.0, -1.0]])
        >>> hits.t.tolist(), hits.point.tolist(), hits.front.tolist()
        ([3.0], [[0.0, 0.0, 2.0]], [True])
        """
        # Fast path: checking costs more than a ray.
        if out is None and type(fields) is tuple and type(tmin) is float and type(tmax) is float:
            if type(origins) is _ndarray and type(directions) is _ndarray:
                ready = self._native.cast_ready(origins, directions, tmin, tmax, fields)
                if ready is not None:
                    return Hits(ready)
        o, d, low, high = rays(origins, directions, tmin, tmax)
        columns = _columns(len(o), o.dtype, fields) if out is None else _checked(out)
        self._native.cast(o, d, low, high, columns)
        return Hits(columns)

    def occluded(
        self,
        origins: npt.ArrayLike,
        directions: npt.ArrayLike,
        tmin: npt.ArrayLike = 0.0,
        tmax: npt.ArrayLike = np.inf,
        *,
        out: npt.NDArray[np.bool_] | None = None,
    ) -> npt.NDArray[np.bool_]:
        """Whether anything is hit, (N,) of bool; arguments as for `cast`. Faster than `cast`.

        >>> import lumbre
        >>> lumbre.Scene([lumbre.Sphere()]).occluded([[0.0, 0.0, 5.0]], [[0.0, 0.0, -1.0]], tmax=3.0).tolist()
        [False]
        """
        if out is None and type(tmin) is float and type(tmax) is float:
            if type(origins) is _ndarray and type(directions) is _ndarray:
                ready = self._native.occluded_ready(origins, directions, tmin, tmax)
                if ready is not None:
                    return ready
        o, d, low, high = rays(origins, directions, tmin, tmax)
        if out is None:
            fits(f"the answers of {len(o)} rays", len(o))
            answer = np.empty(len(o), dtype=np.bool_)
        else:
            answer = _array("out", out)
        self._native.occluded(o, d, low, high, answer)
        return answer

    def count(
        self,
        origins: npt.ArrayLike,
        directions: npt.ArrayLike,
        tmin: npt.ArrayLike = 0.0,
        tmax: npt.ArrayLike = np.inf,
    ) -> npt.NDArray[np.int64]:
        """The number of hits of every ray, (N,); arguments as for `cast`. Edges and vertices of meshes count once.

        >>> import lumbre
        >>> lumbre.Scene([lumbre.Sphere()]).count([[0.0, 0.0, 5.0]], [[0.0, 0.0, -1.0]]).tolist()
        [2]
        """
        o, d, low, high = rays(origins, directions, tmin, tmax)
        fits(f"the answers of {len(o)} rays", 8 * len(o))
        answer = np.empty(len(o), dtype=np.int64)
        self._native.count(o, d, low, high, answer)
        return answer

    def cast_all(
        self,
        origins: npt.ArrayLike,
        directions: npt.ArrayLike,
        tmin: npt.ArrayLike = 0.0,
        tmax: npt.ArrayLike = np.inf,
    ) -> AllHits:
        """Every hit of every ray by ascending t, with offsets per ray; arguments as for `cast`.

        >>> import lumbre
        >>> every = lumbre.Scene([lumbre.Sphere()]).cast_all([[0.0, 0.0, 5.0]], [[0.0, 0.0, -1.0]])
        >>> every.t.tolist(), every.front.tolist()
        ([4.0, 6.0], [True, False])
        """
        o, d, low, high = rays(origins, directions, tmin, tmax)
        return AllHits(self._native.cast_all(o, d, low, high))

    def closest_point(self, points: npt.ArrayLike, max_distance: float = math.inf) -> Nearest:
        """The nearest point of all surfaces, for (N, 3) points.

        If CSG, or a sheared shape, might be nearer, the distance is nan,
        `shape` -1, and a `UserWarning` says for how many points, and why.

        >>> import lumbre
        >>> nearest = lumbre.Scene([lumbre.Sphere(radius=2)]).closest_point([[0.0, 0.0, 5.0]])
        >>> nearest.distance.tolist(), nearest.point.tolist()
        ([3.0], [[0.0, 0.0, 2.0]])
        """
        if not isinstance(max_distance, (int, float, np.integer, np.floating)) or not max_distance >= 0:
            raise LumbreError(f"max_distance is out of range (found {max_distance!r}; expected a number, 0 or more)")
        places = _points(points)
        columns = _columns(len(places), places.dtype, ("t", "point", "shape", "prim", "instance"))
        why = self._native.closest_point(places, max_distance, columns)
        if why is not None:
            unknown = int(np.isnan(columns["t"]).sum())
            warnings.warn(f"the nearest point is not known for {unknown} of {len(places)} points: {why}", stacklevel=2)
        return Nearest({"distance" if name == "t" else name: column for name, column in columns.items()})

    def inside(self, points: npt.ArrayLike) -> npt.NDArray[np.bool_]:
        """Whether (N, 3) points are inside closed bodies, by the even-odd rule: a point inside two counts as outside.

        >>> import lumbre
        >>> lumbre.Scene([lumbre.Sphere(radius=2)]).inside([[0.0, 0.0, 1.0], [0.0, 0.0, 3.0]]).tolist()
        [True, False]
        """
        places = _points(points)
        answer = np.empty(len(places), dtype=np.bool_)
        self._native.inside(places, answer)
        return answer

    def winding_number(self, points: npt.ArrayLike) -> Array:
        """How often surfaces wind around (N, 3) points: 1 inside, 0 outside, in between where a mesh has gaps.

        Raises `LumbreError` where there are open shapes other than meshes.

        >>> import lumbre
        >>> lumbre.Scene([lumbre.Sphere(radius=2)]).winding_number([[0.0, 0.0, 1.0]]).tolist()
        [1.0]
        """
        places = _points(points)
        answer = np.empty(len(places), dtype=places.dtype)
        self._native.winding_number(places, answer)
        return answer

    def signed_distance(self, points: npt.ArrayLike) -> Array:
        """The distance of (N, 3) points to the nearest surface, negative inside: where surfaces wind around a point
        more than 0.5 times, in either direction. So a closed mesh that is inside out has the same signs, as `inside` does.

        Raises `LumbreError` as `winding_number` does; nan where `closest_point` has no answer.

        >>> import lumbre
        >>> lumbre.Scene([lumbre.Sphere(radius=2)]).signed_distance([[0.0, 0.0, 1.5], [0.0, 0.0, 4.0]]).tolist()
        [-0.5, 2.0]
        """
        places = _points(points)
        distance = self.closest_point(places).distance
        return np.where(np.abs(self.winding_number(places)) > 0.5, -distance, distance)

    @answers_names
    def render(
        self,
        spp: int | None = None,
        size: tuple[int, int] | None = None,
        *,
        camera: Camera | int | str | None = None,
        azimuth: float | None = None,
        elevation: float | None = None,
        zoom: float | None = None,
        fit: bool = False,
        env: Any = None,
        ground: str | None = None,
        background: Any = None,
        overrides: Mapping[str, Any] | None = None,
        crop: tuple[int, int, int, int] | None = None,
        integrator: str | None = None,
        max_depth: int | None = None,
        seed: int | None = None,
        threads: int | None = None,
        time: float | None = None,
        noise: float | None = None,
        min_spp: int | None = None,
        transparent: bool = False,
        spectral: bool | None = None,
        features: bool = False,
        denoise: bool | None = None,
        first_sample: int = 0,
        progress: Progress | bool | None = None,
    ) -> Image:
        """Renders a picture, as the program does: a bare model is framed, lit as in a studio, and casts a shadow on a paper background.

        Parameters
        ----------
        spp : samples per pixel
            By default what the scene says, else 64; 16 for a model without camera and light, whose noise is taken out.
        size : (width, height) in pixels
            By default that of a `Pinhole`, else what the scene says.
        camera : Camera, position or name
            A camera of any kind for any scene, or one of the scene's own. Pictures by many cameras share what was built for the first: the
            tree, the lights and the ground. So the studio stands still, while a model is looked at from all sides.
        azimuth, elevation : degrees by which the camera that frames everything goes to the right, and up
            The studio goes along, as of `lumbre render --azimuth`.
        zoom : how many times as large everything is in the picture of the scene's own camera, or of that which frames everything
        fit : frame everything, even if the scene has a camera
        env : light from all around, in place of the scene's own
            A file or an (h, 2h, 3) array by longitude and latitude, its middle behind the model; an `EnvironmentLight` or `SkyLight` as
            it stands; a radiance; "studio"; or "none" besides the scene's own.
        ground : "none", "shadow" (ground on which only shadows are visible), "plane" (matt and grey) or "auto"
        background : what is behind everything
            "env" (the light from there), "studio" (grey paper), "transparent", a colour, an (h, w, 3) array or a file.
        overrides : values by name, as the program's -D
            "material.NAME.PARAM", "light.NUMBER.PARAM", "camera.PARAM" or "film.PARAM": numbers, colours or names of such. A tree is built
            for each new set of them; the last two are kept.
        crop : (x0, y0, x1, y1), upper ends excluded
            Only these pixels.
        integrator : path, caustics, whitted, ambientocclusion, normals, depth, albedo or uv
        max_depth : bounces at most
        seed : whole number, 0 or more
        threads : 0 for one a core
        time, noise : seconds, and relative noise
            The render stops at whichever of spp, time and noise comes first. With noise alone it takes as long as it takes. Where spp or
            time comes first and the noise is not reached, a `UserWarning` says so, as do `noise_target_met`, `noise` and
            `noisy_pixels` of `Image.stats`.
        min_spp : samples per pixel, with noise
            What every pixel has before its noise may end it; by default 16, or up to 256 where most of the light comes by rare samples.
        transparent : leave out what is behind everything, and keep the coverage as `Image.alpha`
        spectral : carry three wavelengths along each path in place of red, green and blue, by the integrator path
            By default where the scene's film is spectral.
        features : gather albedo, normal, depth and uv as well, for `Image.feature`
        denoise : take the noise out; by default only in the light of the studio
        first_sample : index of the first sample of each pixel, for parts of a render
        progress : callable, or True
            Called as progress(samples, total, share) now and then on this thread; total is None while unknown. True shows a bar where
            tqdm is installed.

        The picture is a function of the scene and these arguments, to the bit, on any number of threads. Ctrl-C raises
        KeyboardInterrupt soon. Raises `LumbreError` for options out of range.

        >>> import lumbre
        >>> image = lumbre.Scene([lumbre.Sphere()]).render(spp=1, size=(8, 6))
        >>> image.array.shape, image.array.dtype.name
        ((6, 8, 3), 'float32')
        """
        given = {
            "spp": spp,
            "size": size,
            "crop": crop,
            "camera": camera,
            "azimuth": azimuth,
            "elevation": elevation,
            "zoom": zoom,
            "fit": fit or None,
            "env": env,
            "ground": ground,
            "background": background,
            "overrides": overrides,
            "integrator": integrator,
            "max_depth": max_depth,
            "seed": seed,
            "threads": threads,
            "time": time,
            "noise": noise,
            "min_spp": min_spp,
            "transparent": transparent or None,
            "spectral": spectral,
            "features": features,
            "denoise": denoise,
            "first_sample": first_sample,
        }
        options = _options(given)
        if not (progress is None or isinstance(progress, bool) or callable(progress)):
            raise LumbreError(f"progress is no callable (found {progress!r}; expected True, or a function of samples, total and share)")
        if min_spp is not None and noise is None:
            raise LumbreError("min_spp is for a render to a noise (expected noise as well)")
        if spp is None and noise is not None:
            # As in the program: no limit.
            options["spp"] = 2**20
        elif spp is None and time is not None:
            options["spp"] = 2**32 - 1
        if progress is True:
            with _Bar() as bar:
                image = Image(self._native.render(options, bar))
        else:
            image = Image(self._native.render(options, progress or None))
        stats = image.stats
        if stats["noise_target_met"] is False:
            more = "time" if time is not None and stats["spp"] < options["spp"] else "spp"
            reached = "not known yet" if stats["noise"] is None else stats["noise"]
            warnings.warn(f"the noise is {reached}, not below the target {noise}: give more {more}", stacklevel=3)
        return image

    @answers_names
    def explain(
        self,
        pixel: tuple[int, int] | None = None,
        *,
        ray: tuple[Iterable[float], Iterable[float]] | None = None,
        tmin: float = 0.0,
        tmax: float = math.inf,
        sample: int = 0,
        depth: int = 0,
        nearest: bool = False,
        shape: str | int | None = None,
        all_shapes: bool = False,
        lang: str = "en",
        size: tuple[int, int] | None = None,
        camera: Camera | int | str | None = None,
        integrator: str | None = None,
        seed: int | None = None,
    ) -> Explanation:
        """Explains the colour of a pixel, or the light along a ray, with all numbers as the render computes them.

        Parameters
        ----------
        pixel : (x, y), from (0, 0) in the upper left corner
        ray : (origin, direction), two triples, in place of a pixel; tmin and tmax are its range
        sample : the number of the sample
            The radiance is that which `render` adds to the pixel for it.
        depth : the number of further rays whose crossings are explained, too
        nearest : explain only the visible surface, not those behind it
        shape : explain this shape, whether the ray hits it or not: its number, its kind, or the name of its material
        all_shapes : explain all shapes, also those that the ray misses
        lang : en or es
        size, camera, integrator, seed : as of `render`

        Raises `LumbreError` for a pixel outside of the picture, and for a ray without a direction.

        >>> import lumbre
        >>> scene = lumbre.Scene([lumbre.Sphere(radius=2)])
        >>> told = scene.explain((60, 40), size=(120, 80))
        >>> surfaces = next(section for section in told["sections"] if section["key"] == "surfaces")
        >>> surfaces["sections"][0]["key"]
        'shape 0'
        """
        if (pixel is None) == (ray is None):
            raise LumbreError("expected either a pixel or a ray")
        options = _options({"size": size, "camera": camera, "integrator": integrator, "seed": seed})
        sample, depth = whole("sample", sample), whole("depth", depth)
        if pixel is not None:
            x, y = wholes("pixel", pixel, "x, y")
            pixel = (x, y)
        width, height = options["size"] if "size" in options else self.size
        if pixel is not None and not (0 <= pixel[0] < width and 0 <= pixel[1] < height):
            raise LumbreError(f"pixel {pixel} is outside of the picture (expected less than ({width}, {height}))")
        asked = None
        if ray is not None:
            origin, direction = triple("origin", ray[0]), triple("direction", ray[1])
            if not np.isfinite((origin, direction)).all() or not any(direction) or not tmin <= tmax:
                raise LumbreError(f"invalid ray (found {ray} from {tmin} to {tmax}; expected finite numbers, and a direction)")
            asked = (origin, direction, float(tmin), float(tmax))
        native = self._native
        told = None if shape is None else str(shape)
        return Explanation(lambda format: native.explain(options, pixel, asked, sample, depth, nearest, told, all_shapes, lang, format))

    @answers_names
    def view(self, *, size: tuple[int, int] | None = None, spp: int | None = None, open: bool = True) -> Viewer:
        """Shows the scene in a page of the browser while it is rendered: `lumbre view`, from Python.

        One moves the camera there, looks into pixels, and sees every edit of its files when it is saved. It runs in the background;
        the other queries of the scene stay as they are.

        Parameters
        ----------
        size : (width, height) in pixels
        spp : samples per pixel, as of `render`
        open : open it in the browser of this machine, where it has one

        Raises `OSError` where the system has no address for it.

        >>> import lumbre
        >>> viewer = lumbre.Scene([lumbre.Sphere()]).view(size=(320, 200), open=False)
        >>> viewer.close()
        """
        options = _options({"size": size, "spp": spp})
        viewer = Viewer(self._native.view(options.get("size"), options.get("spp")), self._repr_png_)
        if open:
            viewer.open()
        return viewer

    def save(self, path: str | os.PathLike[str]) -> None:
        """Writes the scene as a .pbrt, which the program and `load` read; images and meshes are written next to it, under its name.

        A scene of a file is in that file. Raises `LumbreError` for what a .pbrt cannot hold, and says what that is: `Curves`, `Implicit`,
        patches, colours of vertices, several cameras, and scenes without a camera or light of their own. Meshes are rounded to single
        precision, with a `UserWarning` where that changes them.

        >>> import lumbre, pathlib, tempfile
        >>> scene = lumbre.Scene([lumbre.Sphere(radius=2)], camera=lumbre.Perspective((0, -9, 0)), lights=[lumbre.EnvironmentLight(1)])
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     path = pathlib.Path(folder, "ball.pbrt")
        ...     scene.save(path)
        ...     lumbre.load(path)
        <lumbre.Scene of 1 sphere>
        """
        # Half of the package, for scenes that are saved alone.
        from .saving import save

        save(self._source, self.size, path)

    @property
    def size(self) -> tuple[int, int]:
        """Width and height of its pictures, where none is asked for."""
        return self._native.size()

    def __repr__(self) -> str:
        shapes = ", ".join(f"{count} {name}" for name, count in self.info["shapes"].items())
        return f"<lumbre.Scene of {shapes or 'nothing'}>"

    def _repr_png_(self) -> bytes:
        width, height = self.size
        factor = 320 / max(width, height)
        small = (max(1, round(width * factor)), max(1, round(height * factor)))
        return self.render(spp=16, size=small, denoise=True).png()

    def __reduce__(self) -> tuple[Callable[..., Scene], tuple[Any, ...]]:
        return _again, (self._source,)


_HINTS = {
    "intersect": "cast(origins, directions) finds the closest hits",
    "intersects": "occluded(origins, directions) says whether anything is hit",
    "raycast": "cast(origins, directions) finds the closest hits",
    "ray_cast": "cast(origins, directions) finds the closest hits",
    "cast_rays": "cast(origins, directions) finds the closest hits",
    "trace": "cast(origins, directions) finds the closest hits",
    "closest": "cast(origins, directions) finds the closest hits",
    "any": "occluded(origins, directions) says whether anything is hit",
    "all": "cast_all(origins, directions) finds every hit",
    "bbox": "bounds has the lowest and the highest corner",
    "aabb": "bounds has the lowest and the highest corner",
    "show": "view() opens it in the browser; in a notebook it shows itself",
    "vertices": "meshes has the arrays of each mesh",
    "faces": "meshes has the arrays of each mesh",
    "triangles": "meshes has the arrays of each mesh",
    "mesh": "meshes has the arrays of each mesh",
    "contains": "inside(points) says which are within closed bodies",
    "distance": "closest_point(points).distance, or signed_distance(points)",
    "sdf": "signed_distance(points)",
    "to_pbrt": "save(path) writes a .pbrt",
    "export": "save(path) writes a .pbrt",
    "write": "save(path) writes a .pbrt",
}


def _again(source: dict[str, Any]) -> Scene:
    """A scene of its source, for pickles."""
    given = dict(source)
    if "paths" in given:
        return load(*given.pop("paths"), **given)
    parts = given.pop("shapes")
    return Scene(parts, **given)


def _hash(source: Mapping[str, Any]) -> str:
    """Identifies the scene that parts of a render are of."""
    # Solids of solids may be hundreds deep, and a pickle takes several calls for each.
    limit = sys.getrecursionlimit()
    sys.setrecursionlimit(max(limit, 16384))
    try:
        return hashlib.sha256(pickle.dumps(source, protocol=4)).hexdigest()
    finally:
        sys.setrecursionlimit(limit)


@answers_names
def load(
    *paths: str | os.PathLike[str],
    lenient: bool = False,
    strict: bool = False,
    frame: float | None = None,
    shutter: float = 0.0,
    animation: str | None = None,
    variant: str | None = None,
) -> Scene:
    """Opens scene files as one scene: .pbrt (also .gz), .gltf, .glb, .obj, .ply, .stl or .pov.

    Parameters
    ----------
    lenient : drop what cannot be used, such as a face with a nan, with a warning
    strict : make warnings errors
    frame : the time in seconds at which animations are looked at; shutter is the exposure around it
    animation, variant : by name, of a glTF

    Raises `LumbreError` with file, line and column for what is wrong, `OSError` (`FileNotFoundError` and its like) for files that
    cannot be read, and `MemoryError` for limits. Warnings are issued as `UserWarning`, and kept in `Scene.warnings`.

    >>> import lumbre, pathlib, tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = pathlib.Path(folder, "triangle.obj")
    ...     _ = path.write_text("v 0 0 0\\nv 1 0 0\\nv 0 1 0\\nf 1 2 3\\n")
    ...     lumbre.load(path)
    <lumbre.Scene of 1 mesh>
    """
    if not paths:
        raise LumbreError("there is no file to open")
    if lenient and strict:
        raise LumbreError("lenient and strict exclude each other")
    names = tuple(os.fspath(path) for path in paths)
    options = {
        "lenient": lenient,
        "strict": strict,
        "frame": frame,
        "shutter": shutter,
        "animation": animation,
        "variant": variant,
    }
    scene = Scene.__new__(Scene)
    scene._source = {"paths": tuple(os.path.abspath(name) for name in names), **options}
    strictness = "lenient" if lenient else "strict" if strict else "normal"
    settings = [(name, repr(value)) for name, value in options.items()]
    native, lines = _lumbre.Scene.open(list(names), strictness, frame, shutter, animation, variant, settings)
    scene._native = native
    scene._warnings = tuple(lines)
    for line in lines:
        warnings.warn(line, stacklevel=3)
    return scene


def _columns(count: int, dtype: np.dtype[Any], fields: Sequence[str]) -> dict[str, Array]:
    """Arrays for these fields, not filled."""
    if isinstance(fields, str):
        fields = (fields,)
    if not isinstance(fields, Iterable):
        raise LumbreError(f"fields are no names (found {fields!r}; expected some of {', '.join(FIELDS)})")
    layouts: dict[str, tuple[tuple[int, ...], np.dtype[Any]]] = {}
    for name in fields:
        if name not in FIELDS:
            raise LumbreError(f'a hit has no field "{name}" (expected some of {", ".join(FIELDS)})')
        width = _WIDTHS.get(name)
        layouts[name] = ((count,) if width is None else (count, width), np.dtype(_KINDS.get(name, dtype)))
    nbytes = sum(math.prod(shape) * kind.itemsize for shape, kind in layouts.values())
    fits(f"the answers of {count} rays", nbytes)
    return {name: np.empty(shape, dtype=kind) for name, (shape, kind) in layouts.items()}


def _options(given: Mapping[str, Any]) -> dict[str, Any]:
    """Options of a render that are given, each of its kind and in its range."""
    options = {name: value for name, value in given.items() if value is not None}
    camera = options.get("camera")
    if isinstance(camera, Camera):
        del options["camera"]
        options["view"] = camera._native()
        if "size" not in options and (size := camera._size()) is not None:
            options["size"] = size
    for name in ("azimuth", "elevation", "zoom", "fit"):
        is_own = name == "zoom" and not isinstance(camera, Camera)
        if name in options and camera is not None and not is_own:
            what = "the camera" if isinstance(camera, Camera) else "a camera of the scene"
            raise LumbreError(f"camera and {name} exclude each other: {name} moves the camera that frames everything, not {what}")
    if "transparent" in options and "background" in options:
        raise LumbreError('transparent and background exclude each other (transparent=True is background="transparent")')
    for name, value in options.items():
        if name == "view":
            continue
        if name == "size":
            options[name] = wholes(name, value, "width, height", 1)
        elif name == "crop":
            options[name] = wholes(name, value, "x0, y0, x1, y1")
        elif name in ("spp", "min_spp"):
            options[name] = whole(name, value, 1)
        elif name in ("max_depth", "threads", "first_sample"):
            options[name] = whole(name, value)
        elif name == "seed":
            options[name] = whole(name, value, 0, 2**64 - 1)
        elif name == "camera":
            options[name] = value if isinstance(value, str) else _position(value)
        elif name in ("azimuth", "elevation"):
            options[name] = _degrees(name, value)
        elif name == "zoom":
            options[name] = positive(name, value, "a factor above 0, such as 1.5")
        elif name == "env":
            options[name] = environment(value)
        elif name == "ground":
            if not isinstance(value, str):
                raise LumbreError(f'ground is no name (found {value!r}; expected "auto", "none", "shadow" or "plane")')
        elif name == "background":
            options[name] = _background(value)
        elif name == "overrides":
            options[name] = _settings(value)
        elif name == "integrator":
            if not isinstance(value, str):
                raise LumbreError(f"integrator is no name (found {value!r})")
        elif name == "time":
            options[name] = positive(name, value, "seconds, above 0")
        elif name == "noise":
            options[name] = positive(name, value, "a relative noise above 0, such as 0.02")
        else:
            options[name] = flag(name, value)
    return options


def _position(value: Any) -> int:
    try:
        return whole("camera", value)
    except LumbreError as error:
        raise LumbreError(
            f"camera is out of range (found {value!r}; expected a Camera, or the position or name of one of the scene's)"
        ) from error


def _degrees(name: str, value: Any) -> float:
    is_number = isinstance(value, (int, float, np.integer, np.floating)) and not isinstance(value, bool)
    if not is_number or not abs(value) <= 1e6:
        raise LumbreError(f"{name} is out of range (found {value!r}; expected degrees, such as 30 or -90)")
    return float(value)


def _background(value: Any) -> Any:
    """What is behind everything, as the native half takes it."""
    if isinstance(value, str) and value in ("env", "studio", "transparent"):
        return value
    is_path = isinstance(value, os.PathLike) or (isinstance(value, str) and not value.startswith("#") and os.path.splitext(value)[1] != "")
    if is_path:
        return _lumbre.read_image(os.fspath(value))[0]
    if isinstance(value, np.ndarray) and value.ndim == 3:
        return array_of("background", value).astype(np.float32, copy=False)
    try:
        return colour("background", value)
    except LumbreError as error:
        expected = 'expected "env", "studio", "transparent", a colour, an (h, w, 3) array or a file'
        raise LumbreError(f"background is no such thing ({expected}): {error}") from error


def _settings(given: Any) -> list[str]:
    """Overrides as the program takes them, `material.wood.reflectance=0.5,0.25,0.125`."""
    if not isinstance(given, Mapping):
        raise LumbreError(f'overrides have no names (found {given!r}; expected a dict such as {{"camera.fov": 30}})')
    lines = []
    for name, value in given.items():
        if not isinstance(name, str):
            raise LumbreError(f"overrides: a name is no text (found {name!r})")
        if isinstance(value, str):
            text = value
        elif isinstance(value, (bool, np.bool_)):
            text = str(bool(value)).lower()
        elif np.ndim(value) == 0:
            text = repr(float(value)) if not isinstance(value, (int, np.integer)) else str(int(value))
        else:
            text = ",".join(repr(float(number)) for number in value)
        lines.append(f"{name}={text}")
    return lines


def _checked(out: Mapping[str, Array]) -> dict[str, Array]:
    if not isinstance(out, Mapping):
        raise LumbreError(f"out has no arrays by name (found {out!r}; expected a dict of some of {', '.join(FIELDS)})")
    for name, array in out.items():
        if name not in FIELDS:
            raise LumbreError(f'a hit has no field "{name}" (expected some of {", ".join(FIELDS)})')
        _array(f"out: {name}", array)
    return dict(out)


def _array(name: str, array: Any) -> Any:
    """An array that can be written."""
    if not isinstance(array, np.ndarray) or isinstance(array, np.ma.MaskedArray):
        raise LumbreError(f"{name} is no array to write (found {type(array).__name__}; expected a numpy.ndarray)")
    if not array.flags.writeable:
        raise LumbreError(f"{name} is read-only")
    return array


def _points(points: npt.ArrayLike) -> Array:
    places = rows("points", points)
    return places.reshape(1, 3) if places.ndim == 1 else places


class _Bar:
    """A bar by tqdm, or nothing where it is not installed."""

    def __enter__(self) -> Progress:
        try:
            from tqdm.auto import tqdm  # type: ignore[import-untyped, unused-ignore]
        except ImportError:
            self._bar = None
            return lambda samples, total, share: None
        bar = tqdm(total=100, unit="%", bar_format="{l_bar}{bar}| {elapsed}<{remaining}")
        self._bar = bar

        def tell(samples: int, total: int | None, share: float) -> None:
            bar.n = round(100 * share)
            bar.refresh()

        return tell

    def __exit__(self, *error: object) -> None:
        if self._bar is not None:
            self._bar.n = 100 if error[0] is None else self._bar.n
            self._bar.close()
