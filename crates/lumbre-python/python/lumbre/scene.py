"""Scenes: opened from files or built of shapes, asked with rays and points, rendered."""

from __future__ import annotations

import hashlib
import math
import os
import pickle
import sys
import warnings
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from . import _lumbre
from ._arrays import Array, fits, flag, positive, rays, rows, triple, whole, wholes
from ._lumbre import LumbreError
from .appearance import Camera, Light
from .explanation import Explanation
from .geometry import Instances, Shape
from .image import Image
from .viewing import Viewer

FIELDS = ("t", "point", "normal", "uv", "front", "shape", "prim", "instance")
"""The fields of a hit, in the order of the program's own columns."""

_WIDTHS = {"point": 3, "normal": 3, "uv": 2}
_KINDS: dict[str, type[Any]] = {"front": np.bool_, "shape": np.int32, "prim": np.int32, "instance": np.int32}
_ndarray = np.ndarray
_NEAREST = ("distance", "point", "shape", "prim", "instance")

Progress = Callable[[int, "int | None", float], object]


class Hits:
    """The closest hits of N rays, an array each; those that were not asked for raise `AttributeError`.

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
        # The columns are the attributes: nothing is sooner made, or found.
        self.__dict__ = columns

    def __getattr__(self, name: str) -> Array:
        raise AttributeError(f"these hits have no {name} (cast with it among the fields)")

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
        Never negative; inf where there is nothing within the distance asked for.
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


class Scene:
    """Shapes with a camera and lights, ready for ray queries and pictures.

    Parameters
    ----------
    shapes : shapes and `Instances`
        What stands there. `Hits.shape` is the position among all shapes, those of instances after the others.
    camera : Camera or list of them, optional
        The first is the default; by default one that sees everything.
    lights : list of lights, optional
        By default studio light, unless a shape emits. With neither camera nor light, everything also stands on its shadow in pictures.
    up : triple
        What is up for the default camera and light; z unless you say otherwise.

    A scene does not change. It may be used from many threads at once, and is pickled by what it was made of. Queries release the
    interpreter's lock, use every core (or as many as RAYON_NUM_THREADS says) and end on Ctrl-C.

    >>> import lumbre
    >>> scene = lumbre.Scene([lumbre.Torus(major=1, minor=0.25), lumbre.Plane(point=(0, 0, -1))])
    >>> int(scene.count([[1.0, 0.0, 5.0]], [[0.0, 0.0, -1.0]])[0])
    3
    """

    def __init__(
        self,
        shapes: Iterable[Shape | Instances] | Shape | Instances,
        *,
        camera: Camera | Sequence[Camera] | None = None,
        lights: Iterable[Light] = (),
        up: Iterable[float] = (0.0, 0.0, 1.0),
    ) -> None:
        parts = [shapes] if isinstance(shapes, (Shape, Instances)) else list(shapes)
        cameras = [] if camera is None else [camera] if isinstance(camera, Camera) else list(camera)
        lamps = list(lights)
        for what, kinds, name in ((parts, (Shape, Instances), "shape"), (cameras, Camera, "camera"), (lamps, Light, "light")):
            for part in what:
                if not isinstance(part, kinds):
                    raise LumbreError(f"this is no {name}: {part!r}")
        source: dict[str, Any] = {"shapes": parts, "camera": cameras, "lights": lamps, "up": triple("up", up)}
        self._source = source
        self._warnings: tuple[str, ...] = ()
        self._native = _lumbre.Scene.build(
            [shape._native() for shape in parts if isinstance(shape, Shape)],
            [shape._native() for shape in parts if isinstance(shape, Instances)],
            [camera._native() for camera in cameras],
            [light._native() for light in lamps],
            source["up"],
            [("scene", _hash(source))],
        )

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
        # The usual arrays need no look from here, which takes longer than a ray.
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
        """Whether anything is hit, (N,) of bool; arguments as for `cast`. Sooner known than what is hit first.

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

        Raises `LumbreError` where something may be nearer that has no answer, such as some shapes under maps that change angles.

        >>> import lumbre
        >>> nearest = lumbre.Scene([lumbre.Sphere(radius=2)]).closest_point([[0.0, 0.0, 5.0]])
        >>> nearest.distance.tolist(), nearest.point.tolist()
        ([3.0], [[0.0, 0.0, 2.0]])
        """
        if not isinstance(max_distance, (int, float, np.integer, np.floating)) or not max_distance >= 0:
            raise LumbreError(f"max_distance is out of range (found {max_distance!r}; expected a number, 0 or more)")
        places = _points(points)
        columns = _columns(len(places), places.dtype, ("t", "point", "shape", "prim", "instance"))
        self._native.closest_point(places, max_distance, columns)
        return Nearest({"distance" if name == "t" else name: column for name, column in columns.items()})

    def inside(self, points: npt.ArrayLike) -> npt.NDArray[np.bool_]:
        """Whether (N, 3) points are inside of closed bodies, even-odd: inside of two is outside.

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

        Raises `LumbreError` as `closest_point` and `winding_number` do.

        >>> import lumbre
        >>> lumbre.Scene([lumbre.Sphere(radius=2)]).signed_distance([[0.0, 0.0, 1.5], [0.0, 0.0, 4.0]]).tolist()
        [-0.5, 2.0]
        """
        places = _points(points)
        distance = self.closest_point(places).distance
        return np.where(np.abs(self.winding_number(places)) > 0.5, -distance, distance)

    def render(
        self,
        spp: int | None = None,
        size: tuple[int, int] | None = None,
        *,
        crop: tuple[int, int, int, int] | None = None,
        camera: int | str | None = None,
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
        """Renders a picture, as the program does: a model by itself is framed, lit as in a studio, and stands on its shadow before paper.

        Parameters
        ----------
        spp : samples per pixel
            By default what the scene says, else 64; 16 for a model without camera and light, whose noise is taken out.
        size : (width, height) in pixels
        crop : (x0, y0, x1, y1), upper ends excluded
            Only these pixels.
        camera : position or name
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
            "integrator": integrator,
            "max_depth": max_depth,
            "seed": seed,
            "threads": threads,
            "time": time,
            "noise": noise,
            "min_spp": min_spp,
            "transparent": transparent,
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
            # As in the program: as many as it takes.
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
            warnings.warn(f"the noise is {reached}, and that of {noise} was not reached: more {more} goes on", stacklevel=2)
        return image

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
        lang: str = "en",
        size: tuple[int, int] | None = None,
        camera: int | str | None = None,
        integrator: str | None = None,
        seed: int | None = None,
    ) -> Explanation:
        """Tells how the colour of a pixel, or the light along a ray, comes about, with all numbers as the render computes them.

        Parameters
        ----------
        pixel : (x, y), from (0, 0) in the upper left corner
        ray : (origin, direction), two triples, in place of a pixel; tmin and tmax are its range
        sample : the number of the sample
            The radiance is that which `render` adds to the pixel for it.
        depth : of how many of the rays that follow the crossings are told, too
        nearest : tell only the surface that is seen, not those behind it
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
            raise LumbreError("either a pixel or a ray is explained")
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
                raise LumbreError(f"this is no ray (found {ray} from {tmin} to {tmax}; expected finite numbers, and a direction)")
            asked = (origin, direction, float(tmin), float(tmax))
        native = self._native
        return Explanation(lambda format: native.explain(options, pixel, asked, sample, depth, nearest, lang, format))

    def view(self, *, size: tuple[int, int] | None = None, spp: int | None = None, open: bool = True) -> Viewer:
        """Shows the scene in a page of the browser while it is rendered: `lumbre view`, from Python.

        One moves the camera there, looks into pixels, and sees every edit of its files when it is saved. It runs beside what Python does;
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


def load(
    *paths: str | os.PathLike[str],
    lenient: bool = False,
    strict: bool = False,
    frame: float | None = None,
    shutter: float = 0.0,
    animation: str | None = None,
    variant: str | None = None,
) -> Scene:
    """Opens scene files as one scene: .pbrt (also .gz), .gltf, .glb, .obj, .ply or .stl.

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
        warnings.warn(line, stacklevel=2)
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
    for name, value in options.items():
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
            options[name] = value if isinstance(value, str) else whole("camera", value)
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
