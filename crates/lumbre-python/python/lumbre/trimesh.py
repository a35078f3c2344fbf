"""Lumbre's rays in trimesh: the methods of its own intersectors, in double precision.

A mesh at a time, or all meshes by trimesh's usual switch, `use_embree`, which is on by default:

>>> import trimesh, lumbre.trimesh
>>> mesh = trimesh.creation.box()
>>> mesh.ray = lumbre.trimesh.RayMeshIntersector(mesh)
>>> mesh.ray.intersects_any([[0.0, 0.0, 5.0]], [[0.0, 0.0, -1.0]]).tolist()
[True]
>>> lumbre.trimesh.enable()
>>> type(trimesh.creation.box().ray).__module__
'lumbre.trimesh'
>>> lumbre.trimesh.disable()
"""

from __future__ import annotations

import sys
from types import ModuleType
from typing import Any

import numpy as np
import numpy.typing as npt

from ._arrays import rows
from .geometry import Mesh
from .scene import Scene

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]

_MODULE = "trimesh.ray.ray_pyembree"


class RayMeshIntersector:
    """Ray queries of a `trimesh.Trimesh`.

    The tree is built at the first query, and again where the mesh has changed. Hits come by ray, those of a ray by distance. Edges and
    vertices count once, so that hits need no removal of doubles, and no ray is moved on by an offset between two hits.

    Parameters
    ----------
    geometry : trimesh.Trimesh
    scale_to_box : bool
        For the signature of trimesh's own: nothing needs to be scaled in double precision.
    precision : "auto", "single" or "double"
        As of `lumbre.Mesh`: single is faster.
    """

    def __init__(self, geometry: Any, scale_to_box: bool = True, precision: str = "auto") -> None:
        self.mesh = geometry
        self._scale_to_box = scale_to_box
        self._precision = precision
        self._built: tuple[int, Scene] | None = None

    @property
    def scene(self) -> Scene:
        """The mesh as a `lumbre.Scene`, for all else that rays and points can be asked."""
        state = hash(self.mesh)
        if self._built is None or self._built[0] != state:
            mesh = Mesh(np.asarray(self.mesh.vertices), np.asarray(self.mesh.faces), precision=self._precision)
            self._built = state, Scene(mesh)
        return self._built[1]

    def intersects_location(
        self, ray_origins: npt.ArrayLike, ray_directions: npt.ArrayLike, multiple_hits: bool = True, **_: Any
    ) -> tuple[Floats, Integers, Integers]:
        """Where rays hit: places (h, 3), the ray of each (h,), and its triangle (h,)."""
        triangles, numbers, places = self.intersects_id(ray_origins, ray_directions, multiple_hits=multiple_hits, return_locations=True)
        return places, numbers, triangles

    def intersects_id(
        self,
        ray_origins: npt.ArrayLike,
        ray_directions: npt.ArrayLike,
        multiple_hits: bool = True,
        max_hits: int | None = None,
        return_locations: bool = False,
        **_: Any,
    ) -> Any:
        """The triangles that rays hit, and the ray of each, (h,) both; with `return_locations` the places too, (h, 3)."""
        origins, directions = _rays(ray_origins, ray_directions)
        if multiple_hits:
            every = self.scene.cast_all(origins, directions)
            keep: Any = slice(None)
            if max_hits is not None:
                keep = np.arange(len(every.t)) - every.offsets[every.ray] < max_hits
            triangles, numbers, places = every.prim[keep], every.ray[keep], every.point[keep]
        else:
            fields = ("prim", "point") if return_locations else ("prim",)
            first = self.scene.cast(origins, directions, fields=fields)
            numbers = np.flatnonzero(first.prim >= 0)
            triangles = first.prim[numbers]
            places = first.point[numbers] if return_locations else None
        triangles, numbers = triangles.astype(np.int64), numbers.astype(np.int64)
        return (triangles, numbers, places) if return_locations else (triangles, numbers)

    def intersects_first(self, ray_origins: npt.ArrayLike, ray_directions: npt.ArrayLike, **_: Any) -> Integers:
        """The first triangle that each ray hits, (n,); -1 for none."""
        hits = self.scene.cast(*_rays(ray_origins, ray_directions), fields=("prim",))
        return hits.prim.astype(np.int64)

    def intersects_any(self, ray_origins: npt.ArrayLike, ray_directions: npt.ArrayLike, **_: Any) -> npt.NDArray[np.bool_]:
        """Whether each ray hits anything, (n,)."""
        return self.scene.occluded(*_rays(ray_origins, ray_directions))

    def contains_points(self, points: npt.ArrayLike) -> npt.NDArray[np.bool_]:
        """Whether points are inside, (n,): by parity where the mesh is watertight, else where the winding number is above 0.5."""
        places = rows("points", points).astype(np.float64, copy=False).reshape(-1, 3)
        if self.mesh.is_watertight:
            return self.scene.inside(places)
        return np.asarray(np.abs(self.scene.winding_number(places)) > 0.5)

    def __getstate__(self) -> dict[str, Any]:
        return {**self.__dict__, "_built": None}

    def __deepcopy__(self, *_: Any) -> RayMeshIntersector:
        return self.__copy__()

    def __copy__(self) -> RayMeshIntersector:
        return RayMeshIntersector(self.mesh, self._scale_to_box, self._precision)


def _rays(origins: npt.ArrayLike, directions: npt.ArrayLike) -> tuple[Floats, Floats]:
    o, d = (np.asarray(array, dtype=np.float64) for array in (origins, directions))
    if o.shape != d.shape:
        raise ValueError("Ray origin and direction don't match!")
    return o.reshape(-1, 3), d.reshape(-1, 3)


_before: tuple[Any, bool] | None = None


def enable() -> None:
    """Makes every mesh that trimesh creates from now on cast its rays by Lumbre, unless it is created with `use_embree=False`."""
    import trimesh.ray

    global _before
    if _before is None:
        _before = trimesh.ray.ray_pyembree, trimesh.ray.has_embree
        trimesh.ray.ray_pyembree, trimesh.ray.has_embree = sys.modules[__name__], True
        sys.modules[_MODULE] = sys.modules[__name__]


def disable() -> None:
    """Takes `enable` back; meshes that are there keep what they have."""
    import trimesh.ray

    global _before
    if _before is not None:
        trimesh.ray.ray_pyembree, trimesh.ray.has_embree = _before
        if isinstance(_before[0], ModuleType):
            sys.modules[_MODULE] = _before[0]
        else:
            sys.modules.pop(_MODULE, None)
        _before = None
