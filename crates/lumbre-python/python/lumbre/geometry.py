"""Shapes: exact ones by their equations, meshes by arrays, and instances of either.

All coordinates are in double precision, and any invertible affine map may place a shape.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from . import _lumbre
from ._arrays import Array, Triple, array_of, positive, real, triple
from ._lumbre import LumbreError
from ._words import Described
from .appearance import Colour, Diffuse, Material, Medium, colour, material_of

_ORIGIN: Triple = (0.0, 0.0, 0.0)
_UP: Triple = (0.0, 0.0, 1.0)


@dataclass(frozen=True, eq=False)
class Shape(metaclass=Described):
    """What all shapes have.

    Parameters
    ----------
    transform : (4, 4) array, optional
        The place: world from object, with the translation in the last column.
    material : Material or colour, optional
        The appearance in pictures; by default matt and grey, or that of the CSG that it is a part of. A colour stands for `Diffuse` of it.
    emission : colour, optional
        Radiance that its front emits, as a number, (r, g, b) or a name.
    medium : Medium, optional
        What it is filled with; without a material its surface is not seen then.

    Solids are combined by `a | b`, `a & b` and `a - b`: see `Union`, `Intersection` and `Difference`.
    """

    transform: npt.ArrayLike | None = field(default=None, kw_only=True)
    material: Material | float | str | Iterable[float] | None = field(default=None, kw_only=True)
    emission: float | str | Iterable[float] | None = field(default=None, kw_only=True)
    medium: Medium | None = field(default=None, kw_only=True)

    def __post_init__(self) -> None:
        object.__setattr__(self, "material", material_of(self.material))
        if not (self.medium is None or isinstance(self.medium, Medium)):
            raise LumbreError(f"medium is no medium (found {self.medium!r}; expected a Medium)")
        # Frozen, so that a scene and its pickle stay the same.
        object.__setattr__(self, "_made", (self._geometry(), self._place(), self._light()))

    def _geometry(self) -> _lumbre.Geometry:
        raise LumbreError("a shape is one of Sphere, Mesh and so on")

    def _place(self) -> list[list[float]] | None:
        if self.transform is None:
            return None
        matrix = array_of("transform", self.transform).astype(np.float64, copy=False)
        if matrix.shape != (4, 4):
            raise LumbreError(f"transform has the wrong shape (found {matrix.shape}; expected (4, 4))")
        rows: list[list[float]] = matrix.tolist()
        return rows

    def _light(self) -> Colour | None:
        return None if self.emission is None else colour("emission", self.emission)

    def _native(self) -> _lumbre._Placed:
        geometry, place, light = self.__dict__["_made"]
        material: Any = self.material
        medium = None if self.medium is None else self.medium._native()
        return geometry, place, None if material is None else material._native(), light, medium

    def __or__(self, other: Shape) -> Union:
        return Union(self, other)

    def __and__(self, other: Shape) -> Intersection:
        return Intersection(self, other)

    def __sub__(self, other: Shape) -> Difference:
        return Difference(self, other)

    def __getstate__(self) -> dict[str, Any]:
        return {name: value for name, value in self.__dict__.items() if name != "_made"}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        self.__post_init__()


@dataclass(frozen=True, eq=False)
class Sphere(Shape):
    """A sphere.

    Raises `LumbreError` unless the radius is above 0.

    >>> Sphere(center=(0, 0, 3), radius=2).radius
    2
    """

    center: Iterable[float] = _ORIGIN
    radius: float = 1.0

    def _geometry(self) -> _lumbre.Geometry:
        return _lumbre.Geometry.sphere(triple("center", self.center), self.radius)


@dataclass(frozen=True, eq=False)
class Plane(Shape):
    """An infinite plane through `point`; `normal` points to its front.

    >>> Plane(point=(0, 0, 0), normal=(0, 0, 1)).normal
    (0, 0, 1)
    """

    point: Iterable[float] = _ORIGIN
    normal: Iterable[float] = _UP

    def _geometry(self) -> _lumbre.Geometry:
        return _lumbre.Geometry.plane(triple("point", self.point), triple("normal", self.normal))


@dataclass(frozen=True, eq=False)
class Disk(Shape):
    """A disk, or with `inner_radius` an annulus.

    >>> Disk(radius=2, inner_radius=0.5).radius
    2
    """

    center: Iterable[float] = _ORIGIN
    normal: Iterable[float] = _UP
    radius: float = 1.0
    inner_radius: float = 0.0

    def _geometry(self) -> _lumbre.Geometry:
        center, normal = triple("center", self.center), triple("normal", self.normal)
        return _lumbre.Geometry.disk(center, normal, self.radius, self.inner_radius)


@dataclass(frozen=True, eq=False)
class Box(Shape):
    """A box along the axes, between two opposite corners.

    >>> Box(p0=(0, 0, 0), p1=(1, 2, 3)).p1
    (1, 2, 3)
    """

    p0: Iterable[float] = (-0.5, -0.5, -0.5)
    p1: Iterable[float] = (0.5, 0.5, 0.5)

    def _geometry(self) -> _lumbre.Geometry:
        return _lumbre.Geometry.cuboid(triple("p0", self.p0), triple("p1", self.p1))


@dataclass(frozen=True, eq=False)
class Cylinder(Shape):
    """A cylinder around the segment from `p0` to `p1`, closed by `caps` or open.

    >>> Cylinder(p0=(0, 0, 0), p1=(0, 0, 2), radius=0.5).caps
    True
    """

    p0: Iterable[float] = _ORIGIN
    p1: Iterable[float] = _UP
    radius: float = 1.0
    caps: bool = True

    def _geometry(self) -> _lumbre.Geometry:
        return _lumbre.Geometry.cylinder(triple("p0", self.p0), triple("p1", self.p1), self.radius, self.caps)


@dataclass(frozen=True, eq=False)
class Cone(Shape):
    """A cone of radius `r0` at `p0` and `r1` at `p1`, closed by `caps` or open.

    >>> Cone(p0=(0, 0, 0), p1=(0, 0, 2), r0=1, r1=0).r1
    0
    """

    p0: Iterable[float] = _ORIGIN
    p1: Iterable[float] = _UP
    r0: float = 1.0
    r1: float = 0.0
    caps: bool = True

    def _geometry(self) -> _lumbre.Geometry:
        p0, p1 = triple("p0", self.p0), triple("p1", self.p1)
        return _lumbre.Geometry.cone(p0, p1, self.r0, self.r1, self.caps)


@dataclass(frozen=True, eq=False)
class Capsule(Shape):
    """A cylinder with round ends: all that is within `radius` of a segment.

    >>> Capsule(p0=(0, 0, 0), p1=(0, 0, 2), radius=0.5).radius
    0.5
    """

    p0: Iterable[float] = _ORIGIN
    p1: Iterable[float] = _UP
    radius: float = 1.0

    def _geometry(self) -> _lumbre.Geometry:
        return _lumbre.Geometry.capsule(triple("p0", self.p0), triple("p1", self.p1), self.radius)


@dataclass(frozen=True, eq=False)
class Torus(Shape):
    """A torus: a tube of radius `minor` around a circle of radius `major`.

    Raises `LumbreError` unless both are above 0.

    >>> Torus(major=1, minor=0.25).minor
    0.25
    """

    major: float = 1.0
    minor: float = 0.25
    center: Iterable[float] = _ORIGIN
    axis: Iterable[float] = _UP

    def _geometry(self) -> _lumbre.Geometry:
        center, axis = triple("center", self.center), triple("axis", self.axis)
        return _lumbre.Geometry.torus(center, axis, self.major, self.minor)


@dataclass(frozen=True, eq=False)
class Paraboloid(Shape):
    """A paraboloid about the z axis, of this radius at `zmax`; `phimax` in degrees.

    >>> Paraboloid(radius=1, zmin=0, zmax=2).zmax
    2
    """

    radius: float = 1.0
    zmin: float = 0.0
    zmax: float = 1.0
    phimax: float = 360.0

    def _geometry(self) -> _lumbre.Geometry:
        return _lumbre.Geometry.paraboloid(self.radius, self.zmin, self.zmax, self.phimax)


@dataclass(frozen=True, eq=False)
class Hyperboloid(Shape):
    """What the segment from `p1` to `p2` sweeps about the z axis; `phimax` in degrees.

    >>> Hyperboloid(p1=(1, 0, -1), p2=(0, 1, 1)).phimax
    360.0
    """

    p1: Iterable[float] = (1.0, 0.0, -1.0)
    p2: Iterable[float] = (0.0, 1.0, 1.0)
    phimax: float = 360.0

    def _geometry(self) -> _lumbre.Geometry:
        return _lumbre.Geometry.hyperboloid(triple("p1", self.p1), triple("p2", self.p2), self.phimax)


@dataclass(frozen=True, eq=False)
class Quadric(Shape):
    """A general quadric by its ten coefficients, in the order of `docs/scene-language.md`; an open one needs a `clip` box.

    >>> Quadric(coefficients=(1, 1, 1, 0, 0, 0, 0, 0, 0, -1)).clip is None
    True
    """

    coefficients: Iterable[float]
    clip: tuple[Iterable[float], Iterable[float]] | None = None

    def _geometry(self) -> _lumbre.Geometry:
        clip = None if self.clip is None else (triple("clip", self.clip[0]), triple("clip", self.clip[1]))
        numbers = [float(number) for number in self.coefficients]
        if len(numbers) != 10:
            raise LumbreError(f"a quadric has ten coefficients (found {len(numbers)})")
        return _lumbre.Geometry.quadric(numbers, clip)


@dataclass(frozen=True, eq=False)
class Triangle(Shape):
    """A triangle in double precision; its front is where the corners run counter-clockwise.

    >>> Triangle(p0=(0, 0, 0), p1=(1, 0, 0), p2=(0, 1, 0)).p1
    (1, 0, 0)
    """

    p0: Iterable[float]
    p1: Iterable[float]
    p2: Iterable[float]

    def _geometry(self) -> _lumbre.Geometry:
        return _lumbre.Geometry.triangle(triple("p0", self.p0), triple("p1", self.p1), triple("p2", self.p2))


@dataclass(frozen=True, eq=False)
class Patch(Shape):
    """A bilinear patch between four corners.

    >>> Patch(p00=(0, 0, 0), p10=(1, 0, 0), p01=(0, 1, 0), p11=(1, 1, 1)).p11
    (1, 1, 1)
    """

    p00: Iterable[float]
    p10: Iterable[float]
    p01: Iterable[float]
    p11: Iterable[float]

    def _geometry(self) -> _lumbre.Geometry:
        corners = [triple(name, getattr(self, name)) for name in ("p00", "p10", "p01", "p11")]
        return _lumbre.Geometry.patch(*corners)


@dataclass(frozen=True, eq=False)
class Implicit(Shape):
    """The surface where an expression in x, y and z is zero, cut off by a box; inside, the expression is negative, as a signed distance is.

    Parameters
    ----------
    expression : str, in the words of Python
        Of numbers, `x`, `y`, `z`, `pi`, `e`, `+ - * /`, `**` with whole exponents and 0.5, parentheses, and the functions `sqrt`, `abs`,
        `sin`, `cos`, `tan`, `exp`, `min`, `max` and `length`. It need not be a distance.
    bounds : two corners of a box
        Where the surface is cut off, and open.

    Crossings are isolated by interval arithmetic: none is lost, however thin the surface is (Mitchell, "Robust Ray Intersection with
    Interval Arithmetic", 1990). That takes longer than a sphere by far. `closest_point` has no answer for it. A function of Python
    is not taken, as it would hold the interpreter's lock for every ray: sample it to a mesh.

    >>> gyroid = Implicit("sin(x)*cos(y) + sin(y)*cos(z) + sin(z)*cos(x)", bounds=((-3, -3, -3), (3, 3, 3)))
    >>> rounded = Implicit("max(abs(x) - 1, abs(y) - 1, abs(z) - 1, length(x, y, z) - 1.3)", bounds=((-2, -2, -2), (2, 2, 2)))
    >>> import lumbre
    >>> lumbre.Scene(rounded).cast([[0.0, 0.0, 5.0]], [[0.0, 0.0, -1.0]]).t.tolist()
    [4.0]
    """

    expression: str
    bounds: tuple[Iterable[float], Iterable[float]] = ((-1.0, -1.0, -1.0), (1.0, 1.0, 1.0))

    def _geometry(self) -> _lumbre.Geometry:
        if not isinstance(self.expression, str):
            raise LumbreError(f'expression is no text (found {self.expression!r}; expected one such as "x**2 + y**2 + z**2 - 1")')
        try:
            p0, p1 = self.bounds
        except (TypeError, ValueError) as error:
            raise LumbreError(f"bounds are no box (found {self.bounds!r}; expected two corners)") from error
        return _lumbre.Geometry.implicit(self.expression, triple("bounds", p0), triple("bounds", p1))


@dataclass(frozen=True, eq=False)
class AreaLight(Shape):
    """A rectangle that emits light towards `target`: `width` (along the horizon) by `height` units, with this radiance.

    It is a shape like any other, of a `Patch`, and seen in pictures.

    >>> AreaLight(center=(0, 0, 4), width=2, height=1, radiance=10).radiance
    10
    """

    center: Iterable[float]
    target: Iterable[float] = _ORIGIN
    width: float = 1.0
    height: float = 1.0
    radiance: float | str | Iterable[float] = 1.0

    def _geometry(self) -> _lumbre.Geometry:
        center, target = np.array(triple("center", self.center)), np.array(triple("target", self.target))
        along = target - center
        distance = float(np.linalg.norm(along))
        if not 0 < distance < np.inf:
            raise LumbreError(f"target is no direction from center (found {self.target!r} for both; expected another place)")
        along /= distance
        across = np.cross(along, _UP)
        across = across if np.linalg.norm(across) > 1e-6 else np.array([1.0, 0.0, 0.0])
        across = across / np.linalg.norm(across)
        upwards = np.cross(across, along)
        x = 0.5 * positive("width", self.width, "a length above 0") * across
        y = 0.5 * positive("height", self.height, "a length above 0") * upwards
        # Its front is where u and v turn counter-clockwise.
        corners = [triple("corner", corner) for corner in (center + x - y, center - x - y, center + x + y, center - x + y)]
        return _lumbre.Geometry.patch(*corners)

    def _light(self) -> Colour | None:
        return colour("radiance", self.radiance)


@dataclass(frozen=True, eq=False)
class Curves(Shape):
    """Hair, fur, grass: smooth curves through points, with a width at each. All of them are one shape.

    Parameters
    ----------
    points : (N, K, 3) array, or N arrays of (K, 3)
        Two points or more of each curve.
    widths : number, (N, K) array, or N arrays of (K,)
        The whole width at each point, above 0.
    kind : "flat", "cylinder" or "ribbon"
        Bands that face every ray, the same with the normals of tubes, or bands that face along `normals`.
    normals : (N, K, 3) array, or N arrays of (K, 3), for ribbons
        Where the band faces, at each point.

    In results `primitive` is the segment between two points, among those of all curves.

    >>> Curves([[[0, 0, 0], [0, 0, 1], [0, 0.5, 2]]], 0.1).kind
    'flat'
    """

    points: Any
    widths: Any
    kind: str = "flat"
    normals: Any = None

    def __post_init__(self) -> None:
        points = [_table("points", curve) for curve in self.points]
        if self.normals is not None:
            normals = [_table("normals", each) for each in self.normals]
            if [len(each) for each in normals] != [len(curve) for curve in points]:
                raise LumbreError("normals have the wrong shape (expected one for each point)")
            object.__setattr__(self, "normals", normals)
        widths = self.widths
        if np.ndim(widths) == 0 and not isinstance(widths, (list, tuple)):
            widths = [np.full(len(curve), widths) for curve in points]
        widths = [real(array_of("widths", each)) for each in widths]
        if len(widths) != len(points) or any(w.shape != (len(p),) for w, p in zip(widths, points, strict=True)):
            raise LumbreError("widths have the wrong shape (expected one for each point)")
        object.__setattr__(self, "points", points)
        object.__setattr__(self, "widths", widths)
        super().__post_init__()

    def _geometry(self) -> _lumbre.Geometry:
        counts = np.array([len(curve) for curve in self.points], dtype=np.int64)
        points = np.concatenate([np.zeros((0, 3)), *self.points]).astype(np.float64, copy=False)
        widths = np.concatenate([np.zeros(0), *self.widths]).astype(np.float64, copy=False)
        normals = None
        if self.normals is not None:
            normals = np.concatenate([np.zeros((0, 3)), *self.normals]).astype(np.float64, copy=False)
        return _lumbre.Geometry.curves(points, widths, counts, self.kind, normals)

    def __repr__(self) -> str:
        return f"Curves({len(self.points)} curves)"


@dataclass(frozen=True, eq=False)
class Mesh(Shape):
    """Triangles or quads by index.

    Parameters
    ----------
    vertices : (V, 3) array of float32 or float64
        float64 vertices keep their precision: rays meet the triangles between these very points. Where single precision holds every
        one of them exactly, it is used, for speed.
    faces : (F, 3) or (F, 4) array of integers
        Vertices of each face, counter-clockwise from its front.
    normals : (V, 3) array, optional
        Shading normals, for pictures.
    uvs : (V, 2) array, optional
        Texture coordinates, for pictures and `Hits.uv`; v goes up from the bottom row of an image.
    colors : (V, 3) array, optional
        Linear colours, which it has where it has no material.
    precision : "auto", "single" or "double"
        "single" rounds float64 vertices, which halves the memory and is faster; "auto" goes by what `vertices` are.

    Raises `LumbreError` for faces that name missing vertices, for vertices that are not finite, and for quads that single precision
    does not hold.

    >>> mesh = Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
    >>> mesh.vertices.shape, mesh.faces.shape
    ((3, 3), (1, 3))
    """

    vertices: Array
    faces: Array
    normals: Array | None = None
    uvs: Array | None = None
    colors: Array | None = None
    precision: str = "auto"

    def __init__(
        self,
        vertices: Any,
        faces: npt.ArrayLike | None = None,
        normals: npt.ArrayLike | None = None,
        uvs: npt.ArrayLike | None = None,
        precision: str = "auto",
        *,
        colors: npt.ArrayLike | None = None,
        transform: npt.ArrayLike | None = None,
        material: Material | float | str | Iterable[float] | None = None,
        emission: float | str | Iterable[float] | None = None,
        medium: Medium | None = None,
    ) -> None:
        if faces is None:
            if not is_trimesh(vertices):
                raise LumbreError("faces are missing (expected an (F, 3) array of vertex numbers, or a trimesh.Trimesh alone)")
            taken = _of_trimesh(vertices)
            vertices, faces = taken["vertices"], taken["faces"]
            uvs = taken["uvs"] if uvs is None else uvs
            if material is None and colors is None:
                material, colors = taken["material"], taken["colors"]
        if precision not in ("auto", "single", "double"):
            raise LumbreError(f'precision is unknown (found "{precision}"; expected auto, single, double)')
        tables = {"vertices": vertices, "normals": normals, "uvs": uvs, "colors": colors}
        given: dict[str, Any] = {name: None if table is None else _table(name, table) for name, table in tables.items()}
        corners = array_of("faces", faces)
        if corners.size == 0 and corners.ndim != 2:
            corners = np.zeros((0, 3), dtype=np.int64)
        if corners.dtype.kind not in "iu" and corners.size > 0:
            raise LumbreError(f"faces are of the wrong kind (found {corners.dtype}; expected integers)")
        if corners.ndim != 2:
            raise LumbreError(f"faces have the wrong shape (found {corners.shape}; expected (F, 3) or (F, 4))")
        given |= {"faces": corners, "precision": precision}
        given |= {"transform": transform, "material": material, "emission": emission, "medium": medium}
        for name, value in given.items():
            object.__setattr__(self, name, value)
        self.__post_init__()

    @staticmethod
    def from_trimesh(
        mesh: Any,
        *,
        precision: str = "auto",
        transform: npt.ArrayLike | None = None,
        material: Material | float | str | Iterable[float] | None = None,
        emission: float | str | Iterable[float] | None = None,
        medium: Medium | None = None,
    ) -> Mesh:
        """The mesh of a `trimesh.Trimesh`, with its texture coordinates, and its colours or its picture where it has such and no `material`
        is given. `Mesh(mesh)` is the same.

        >>> import trimesh
        >>> Mesh.from_trimesh(trimesh.creation.box()).faces.shape
        (12, 3)
        """
        if not is_trimesh(mesh):
            raise LumbreError(f"mesh is no trimesh.Trimesh (found {type(mesh).__name__})")
        return Mesh(mesh, precision=precision, transform=transform, material=material, emission=emission, medium=medium)

    def _geometry(self) -> _lumbre.Geometry:
        def double(array: Array | None) -> Array | None:
            return None if array is None else array.astype(np.float64, copy=False)

        vertices = self.vertices.astype(np.float64, copy=False)
        is_precise = self.precision == "double"
        if self.precision == "auto" and self.vertices.dtype == np.float64:
            with np.errstate(over="ignore"):
                is_precise = not np.array_equal(vertices.astype(np.float32), vertices, equal_nan=True)
        faces = self.faces.astype(np.int64, copy=False)
        tables = double(self.normals), double(self.uvs), double(self.colors)
        return _lumbre.Geometry.mesh(vertices, faces, *tables, is_precise)

    def __repr__(self) -> str:
        return f"Mesh({len(self.vertices)} vertices, {len(self.faces)} faces)"


def is_trimesh(value: Any) -> bool:
    """Whether something is a mesh of trimesh, which need not be installed."""
    return any(kind.__module__.split(".")[0] == "trimesh" and kind.__name__ == "Trimesh" for kind in type(value).__mro__)


def _of_trimesh(mesh: Any) -> dict[str, Any]:
    """What there is in a mesh of trimesh, by our names."""
    taken: dict[str, Any] = {"vertices": np.asarray(mesh.vertices), "faces": np.asarray(mesh.faces)}
    taken |= dict.fromkeys(("uvs", "colors", "material"))
    visual = getattr(mesh, "visual", None)
    if visual is None or not getattr(visual, "defined", False):
        return taken
    uv = getattr(visual, "uv", None)
    if uv is not None and len(uv) == len(taken["vertices"]):
        taken["uvs"] = np.asarray(uv, dtype=np.float64)
    if visual.kind == "texture":
        look = visual.material
        image = getattr(look, "baseColorTexture", None) if hasattr(look, "baseColorTexture") else getattr(look, "image", None)
        if image is not None and taken["uvs"] is not None:
            taken["material"] = Diffuse(np.asarray(image.convert("RGB")))
        else:
            taken["material"] = Diffuse(tuple(_linear(np.asarray(look.main_color[:3]))))
    elif visual.kind == "vertex":
        taken["colors"] = _linear(np.asarray(visual.vertex_colors)[:, :3])
    elif visual.kind == "face":
        colours = np.asarray(visual.face_colors)[:, :3]
        if (colours == colours[0]).all():
            taken["material"] = Diffuse(tuple(_linear(colours[0])))
        else:
            # Each face has corners of its own.
            taken["vertices"] = taken["vertices"][taken["faces"]].reshape(-1, 3)
            taken["colors"] = np.repeat(_linear(colours), 3, axis=0)
            taken["faces"] = np.arange(len(taken["vertices"])).reshape(-1, 3)
    return taken


def _linear(colours: npt.NDArray[Any]) -> npt.NDArray[np.float64]:
    """Linear light of bytes in sRGB (IEC 61966-2-1)."""
    encoded = np.asarray(colours, dtype=np.float64) / 255
    return np.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4)


def _table(name: str, value: npt.ArrayLike) -> Array:
    array = real(array_of(name, value))
    if array.size == 0 and array.ndim != 2:
        array = array.reshape(0, 3)
    if array.ndim != 2:
        raise LumbreError(f"{name} has the wrong shape (found {array.shape}; expected two axes)")
    return array


class _Csg(Shape):
    """Operands, each a solid, or several whose union it is."""

    operands: tuple[Shape | Sequence[Shape], ...]
    _operation = ""

    def __init__(
        self,
        *operands: Shape | Sequence[Shape],
        transform: npt.ArrayLike | None = None,
        material: Material | float | str | Iterable[float] | None = None,
        emission: float | str | Iterable[float] | None = None,
        medium: Medium | None = None,
    ) -> None:
        name = type(self).__name__
        if len(operands) < 2:
            raise LumbreError(f"{name} has too few operands (found {len(operands)}; expected two or more)")
        for operand in operands:
            for shape in operand if isinstance(operand, (list, tuple)) else [operand]:
                if not isinstance(shape, Shape):
                    raise LumbreError(f"an operand of {name} is no shape: {shape!r}")
        kept = tuple(operand if isinstance(operand, Shape) else tuple(operand) for operand in operands)
        given = {"operands": kept, "transform": transform, "material": material, "emission": emission, "medium": medium}
        for field_name, value in given.items():
            object.__setattr__(self, field_name, value)
        self.__post_init__()

    def _geometry(self) -> _lumbre.Geometry:
        operands = [[shape._native() for shape in _listed(operand)] for operand in self.operands]
        return _lumbre.Geometry.csg(self._operation, operands)

    def __repr__(self) -> str:
        return f"{type(self).__name__}({', '.join(map(repr, self.operands))})"


def _listed(operand: Shape | Sequence[Shape]) -> Sequence[Shape]:
    return [operand] if isinstance(operand, Shape) else operand


class Union(_Csg):
    """What is in any of two or more solids, without the surfaces inside: `a | b`.

    Solids are closed shapes, closed meshes, half-spaces below a `Plane`, quadrics, and unions, intersections and differences of these;
    an operand may also be a list, and is the union of its shapes then. Each surface keeps its material and its own number in
    `Hits.shape`, which counts shapes in the order in which they are written; the whole has none. `transform`, `material` and
    `emission` are as of every shape; the last two are for operands that have none of their own. What is no solid is refused by `Scene`.

    >>> import lumbre
    >>> both = Sphere(radius=2) | Sphere(center=(3, 0, 0), radius=2)
    >>> int(lumbre.Scene(both).count([[-5.0, 0.0, 0.0]], [[1.0, 0.0, 0.0]])[0])
    2
    """

    _operation = "union"


class Intersection(_Csg):
    """What is in all of two or more solids: `a & b`. Arguments as for `Union`.

    >>> import lumbre
    >>> lens = Sphere(center=(0, 0, -2), radius=3) & Sphere(center=(0, 0, 2), radius=3)
    >>> lumbre.Scene(lens).bounds[:, 2].round(6).tolist()
    [-1.0, 1.0]
    """

    _operation = "intersection"


class Difference(_Csg):
    """What is in the first of two or more solids and in no other: `a - b`. Arguments as for `Union`.

    >>> import lumbre
    >>> pipe = Cylinder(p1=(0, 0, 4), radius=2) - Cylinder(p0=(0, 0, -1), p1=(0, 0, 5), radius=1.5)
    >>> hits = lumbre.Scene(pipe).cast_all([[-5.0, 0.0, 1.0]], [[1.0, 0.0, 0.0]])
    >>> hits.t.tolist(), hits.shape.tolist()
    ([3.0, 3.5, 6.5, 7.0], [0, 1, 1, 0])
    """

    _operation = "difference"


@dataclass(frozen=True, eq=False)
class Instances(metaclass=Described):
    """The same shapes in many places, at the memory of one.

    Parameters
    ----------
    shapes : a shape, or a list of them
    transforms : (N, 4, 4) array
        One place each: world from object. `Hits.instance` counts them over all `Instances` of a scene.

    >>> places = np.tile(np.eye(4), (3, 1, 1))
    >>> places[:, 2, 3] = [0, 2, 4]
    >>> len(Instances(Sphere(radius=0.5), places))
    3
    """

    shapes: Shape | Sequence[Shape]
    transforms: npt.ArrayLike

    def __len__(self) -> int:
        return len(self._places())

    def _places(self) -> Array:
        places = array_of("transforms", self.transforms).astype(np.float64, copy=False)
        if places.ndim != 3 or places.shape[1:] != (4, 4):
            raise LumbreError(f"transforms have the wrong shape (found {places.shape}; expected (N, 4, 4))")
        return places

    def _native(self) -> tuple[list[_lumbre._Placed], Array]:
        shapes = [self.shapes] if isinstance(self.shapes, Shape) else self.shapes
        return [shape._native() for shape in shapes], self._places()


def translate(x: float | Iterable[float], y: float | None = None, z: float | None = None) -> npt.NDArray[np.float64]:
    """The (4, 4) map that moves by three numbers, or by a triple: for `transform=`. Maps are multiplied by `@`, the last one first.

    >>> (translate(1, 2, 3) @ [0, 0, 0, 1]).tolist()
    [1.0, 2.0, 3.0, 1.0]
    """
    given: Any = x if y is None and z is None else (x, y, z)
    matrix = np.eye(4)
    matrix[:3, 3] = _finite("translate", triple("translate", given))
    return matrix


def rotate(axis: str | Iterable[float], degrees: float, about: Iterable[float] = _ORIGIN) -> npt.NDArray[np.float64]:
    """The (4, 4) map that turns by an angle in degrees about an axis, "x", "y", "z" or a vector, through the point `about`:
    counter-clockwise as seen from the axis's tip.

    >>> (rotate("z", 90) @ [1, 0, 0, 1]).round(12).tolist()
    [0.0, 1.0, 0.0, 1.0]
    """
    named = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}
    if isinstance(axis, str):
        if axis not in named:
            raise LumbreError(f'axis is unknown (found "{axis}"; expected "x", "y", "z" or a vector)')
        axis = named[axis]
    a = np.array(_finite("axis", triple("axis", axis)))
    length = float(np.linalg.norm(a))
    if length == 0:
        raise LumbreError("axis is no direction (found (0, 0, 0); expected a vector of some length)")
    if isinstance(degrees, bool) or not isinstance(degrees, (int, float, np.integer, np.floating)) or not np.isfinite(degrees):
        raise LumbreError(f"degrees are out of range (found {degrees!r}; expected a finite number)")
    x, y, z = a / length
    # Whole quarters of a turn are exact.
    quarters, rest = divmod(float(degrees), 90.0)
    sine, cosine = np.sin(np.radians(rest)), np.cos(np.radians(rest))
    for _ in range(int(quarters) % 4):
        sine, cosine = cosine, -sine
    skew = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    turn = cosine * np.eye(3) + sine * skew + (1 - cosine) * np.outer((x, y, z), (x, y, z))
    matrix = np.eye(4)
    matrix[:3, :3] = turn
    center = np.array(_finite("about", triple("about", about)))
    matrix[:3, 3] = center - turn @ center
    return matrix


def scale(x: float | Iterable[float], y: float | None = None, z: float | None = None) -> npt.NDArray[np.float64]:
    """The (4, 4) map that scales by one number, by three, or by a triple; none of them 0.

    >>> (scale(1, 2, 3) @ [1, 1, 1, 1]).tolist()
    [1.0, 2.0, 3.0, 1.0]
    >>> (scale(2) @ [1, 1, 1, 1]).tolist()
    [2.0, 2.0, 2.0, 1.0]
    """
    given: Any = (x, y, z)
    if y is None and z is None:
        given = (x, x, x) if isinstance(x, (int, float, np.integer, np.floating)) else x
    factors = _finite("scale", triple("scale", given))
    if 0.0 in factors:
        raise LumbreError(f"scale is out of range (found {factors}; expected numbers other than 0)")
    return np.diag([*factors, 1.0])


def _finite(name: str, value: Triple) -> Triple:
    if not np.isfinite(value).all():
        raise LumbreError(f"{name} is not finite (found {value}; expected three numbers)")
    return value
