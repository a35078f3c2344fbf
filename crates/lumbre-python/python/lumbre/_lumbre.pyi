from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, final

import numpy as np
import numpy.typing as npt

_Array = npt.NDArray[Any]
_Triple = tuple[float, float, float]
_Placed = tuple[Geometry, list[list[float]] | None, Material | None, _Triple | None]

__all__ = [
    "LumbreError",
    "Part",
    "Picture",
    "read_image",
    "write_image",
    "main",
    "Scene",
    "Camera",
    "Geometry",
    "Light",
    "Material",
    "Texture",
    "thread_count",
]

class LumbreError(ValueError): ...

def main(words: Sequence[str]) -> int: ...
def read_image(path: str) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.float32] | None]: ...
def write_image(path: str, pixels: npt.NDArray[np.float32], tonemap: str, exposure: float) -> None: ...
def thread_count() -> int: ...

@final
class Geometry:
    @staticmethod
    def sphere(center: _Triple, radius: float) -> Geometry: ...
    @staticmethod
    def plane(point: _Triple, normal: _Triple) -> Geometry: ...
    @staticmethod
    def disk(center: _Triple, normal: _Triple, radius: float, inner_radius: float) -> Geometry: ...
    @staticmethod
    def cuboid(p0: _Triple, p1: _Triple) -> Geometry: ...
    @staticmethod
    def cylinder(p0: _Triple, p1: _Triple, radius: float, caps: bool) -> Geometry: ...
    @staticmethod
    def cone(p0: _Triple, p1: _Triple, r0: float, r1: float, caps: bool) -> Geometry: ...
    @staticmethod
    def capsule(p0: _Triple, p1: _Triple, radius: float) -> Geometry: ...
    @staticmethod
    def torus(center: _Triple, axis: _Triple, major: float, minor: float) -> Geometry: ...
    @staticmethod
    def paraboloid(radius: float, zmin: float, zmax: float, phimax: float) -> Geometry: ...
    @staticmethod
    def hyperboloid(p1: _Triple, p2: _Triple, phimax: float) -> Geometry: ...
    @staticmethod
    def quadric(coefficients: Sequence[float], clip: tuple[_Triple, _Triple] | None) -> Geometry: ...
    @staticmethod
    def triangle(p0: _Triple, p1: _Triple, p2: _Triple) -> Geometry: ...
    @staticmethod
    def patch(p00: _Triple, p10: _Triple, p01: _Triple, p11: _Triple) -> Geometry: ...
    @staticmethod
    def csg(operation: str, operands: Sequence[Sequence[_Placed]]) -> Geometry: ...
    @staticmethod
    def mesh(
        vertices: _Array, faces: _Array, normals: _Array | None, uvs: _Array | None, colors: _Array | None, is_precise: bool
    ) -> Geometry: ...

@final
class Texture:
    def __new__(
        cls, texels: _Array, is_srgb: bool, wrap: str, filter: str, scale: tuple[float, float], offset: tuple[float, float]
    ) -> Texture: ...

_Colour = Texture | _Triple
_Number = Texture | float

@final
class Material:
    @staticmethod
    def diffuse(reflectance: _Colour) -> Material: ...
    @staticmethod
    def metal(reflectance: _Colour, roughness: _Number) -> Material: ...
    @staticmethod
    def glass(eta: float, roughness: _Number) -> Material: ...
    @staticmethod
    def pane(eta: float) -> Material: ...
    @staticmethod
    def coated(reflectance: _Colour, roughness: _Number, eta: float) -> Material: ...
    @staticmethod
    def translucent(reflectance: _Colour, transmittance: _Colour) -> Material: ...
    @staticmethod
    def mix(first: Material, second: Material, amount: _Number) -> Material: ...
    @staticmethod
    def principled(
        base_color: _Colour,
        metallic: _Number,
        roughness: _Number,
        transmission: _Number,
        clearcoat: _Number,
        clearcoat_roughness: _Number,
        sheen_color: _Colour,
        sheen_roughness: _Number,
        specular: _Number,
        specular_color: _Colour,
        ior: float,
        attenuation: tuple[_Triple, float] | None,
    ) -> Material: ...
    def tilted(self, normal_map: Texture | None, bump_map: Texture | None) -> Material: ...

@final
class Light:
    @staticmethod
    def point(position: _Triple, intensity: _Triple) -> Light: ...
    @staticmethod
    def spot(position: _Triple, target: _Triple, intensity: _Triple, angle: float, falloff: float) -> Light: ...
    @staticmethod
    def distant(towards: _Triple, irradiance: _Triple) -> Light: ...
    @staticmethod
    def environment(radiance: _Triple, image: _Array | None, up: _Triple) -> Light: ...

@final
class Camera:
    @staticmethod
    def perspective(eye: _Triple, target: _Triple, up: _Triple, fov: float, lens_radius: float) -> Camera: ...
    @staticmethod
    def orthographic(eye: _Triple, target: _Triple, up: _Triple, height: float) -> Camera: ...
    @staticmethod
    def panorama(eye: _Triple, target: _Triple, up: _Triple) -> Camera: ...
    def rays(self, width: int, height: int) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]: ...

@final
class Picture:
    def pixels(self) -> npt.NDArray[np.float32]: ...
    def alpha(self) -> npt.NDArray[np.float32] | None: ...
    def feature(self, name: str) -> tuple[npt.NDArray[np.float32], int] | None: ...
    def save(
        self,
        path: str,
        layers: Sequence[str],
        tonemap: str | None,
        exposure: float | None,
        depth: int,
        quality: int,
        precision: str | None,
    ) -> None: ...
    def png(self, tonemap: str | None, exposure: float | None) -> bytes: ...
    def stats(self) -> dict[str, Any]: ...
    def take_part(self) -> Part: ...

@final
class Part:
    @staticmethod
    def from_bytes(bytes: bytes) -> Part: ...
    def to_bytes(self) -> bytes: ...
    def merge(self, bytes: bytes) -> None: ...
    def pieces(self) -> list[tuple[int, int, tuple[int, int, int, int]]]: ...
    def picture(self) -> Picture: ...

@final
class Scene:
    @staticmethod
    def open(
        paths: Sequence[str],
        strictness: str,
        frame: float | None,
        shutter: float,
        animation: str | None,
        variant: str | None,
        settings: Sequence[tuple[str, str]],
    ) -> tuple[Scene, list[str]]: ...
    @staticmethod
    def build(
        shapes: Sequence[_Placed],
        instances: Sequence[tuple[Sequence[_Placed], _Array]],
        cameras: Sequence[Camera],
        lights: Sequence[Light],
        up: _Triple,
        settings: Sequence[tuple[str, str]],
    ) -> Scene: ...
    def cast(
        self,
        origins: _Array,
        directions: _Array,
        tmin: float | _Array,
        tmax: float | _Array,
        out: dict[str, _Array],
    ) -> None: ...
    def cast_ready(
        self, origins: _Array, directions: _Array, tmin: float, tmax: float, fields: tuple[str, ...]
    ) -> dict[str, _Array] | None: ...
    def occluded_ready(self, origins: _Array, directions: _Array, tmin: float, tmax: float) -> npt.NDArray[np.bool_] | None: ...
    def occluded(
        self,
        origins: _Array,
        directions: _Array,
        tmin: float | _Array,
        tmax: float | _Array,
        out: _Array,
    ) -> None: ...
    def count(
        self,
        origins: _Array,
        directions: _Array,
        tmin: float | _Array,
        tmax: float | _Array,
        out: _Array,
    ) -> None: ...
    def cast_all(self, origins: _Array, directions: _Array, tmin: float | _Array, tmax: float | _Array) -> dict[str, _Array]: ...
    def closest_point(self, points: _Array, max_distance: float, out: dict[str, _Array]) -> None: ...
    def inside(self, points: _Array, out: _Array) -> None: ...
    def winding_number(self, points: _Array, out: _Array) -> None: ...
    def render(self, options: dict[str, Any], progress: Callable[[int, int | None, float], object] | None) -> Picture: ...
    def explain(
        self,
        options: dict[str, Any],
        pixel: tuple[int, int] | None,
        ray: tuple[_Triple, _Triple, float, float] | None,
        sample: int,
        depth: int,
        nearest: bool,
        lang: str,
        format: str,
    ) -> str: ...
    def info(self) -> dict[str, Any]: ...
    def files(self) -> list[Path]: ...
    def hash_files(self) -> None: ...
    def samples(self) -> int: ...
    def size(self) -> tuple[int, int]: ...
