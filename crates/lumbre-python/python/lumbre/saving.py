"""Scenes of shapes as files of the scene language, which is pbrt's with additions."""

from __future__ import annotations

import math
import os
import warnings
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from . import _lumbre
from ._lumbre import LumbreError
from .appearance import (
    Camera,
    Coated,
    Diffuse,
    DistantLight,
    EnvironmentLight,
    Glass,
    Hair,
    Light,
    Material,
    Medium,
    Metal,
    Mix,
    Orthographic,
    Perspective,
    Pinhole,
    PointLight,
    Principled,
    SkyLight,
    SpotLight,
    SunLight,
    Texture,
    ThinGlass,
    Translucent,
    colour,
    rigid,
)
from .geometry import (
    AreaLight,
    Box,
    Capsule,
    Cone,
    Curves,
    Cylinder,
    Disk,
    Hyperboloid,
    Instances,
    Mesh,
    Paraboloid,
    Patch,
    Plane,
    Quadric,
    Shape,
    Sphere,
    Torus,
    Triangle,
    _Csg,
    _listed,
)


def save(source: dict[str, Any], size: tuple[int, int], path: str | os.PathLike[str]) -> None:
    """Writes a scene of shapes as a .pbrt, with its images and meshes next to it."""
    target = Path(os.fspath(path))
    if target.suffix != ".pbrt":
        raise LumbreError(f'{target}: a scene is saved as .pbrt (found "{target.suffix}")')
    if "paths" in source:
        raise LumbreError(f"a scene of files is not saved: it is in {', '.join(map(str, source['paths']))}")
    # All is made before any file is written: what cannot be saved leaves none behind.
    writer = _Writer(target)
    writer.scene(source, size)
    if writer.rounded:
        message = f"{writer.rounded} vertices of meshes are rounded to single precision, as a .pbrt has them"
        warnings.warn(message, stacklevel=3)
    for name, pixels in writer.images.items():
        _lumbre.write_image(os.fspath(target.with_name(name)), pixels, "none", 0.0)
    text = "\n".join([*writer.lines, ""]).encode()
    for name, data in (*writer.meshes.items(), (target.name, text)):
        # A file is the old one or the whole new one.
        partial = target.with_name(name + ".part")
        partial.write_bytes(data)
        os.replace(partial, target.with_name(name))


def _number(value: float) -> str:
    number = float(value)
    if math.isinf(number):
        return "inf" if number > 0 else "-inf"
    return repr(int(number)) if number.is_integer() and abs(number) < 2**53 else repr(number)


def _numbers(values: Iterable[float]) -> str:
    return " ".join(_number(value) for value in values)


def _param(kind: str, name: str, values: Any) -> str:
    if kind == "bool":
        return f'"bool {name}" {"true" if values else "false"}'
    if kind in ("string", "texture"):
        return f'"{kind} {name}" "{values}"'
    listed = [values] if np.ndim(values) == 0 else np.asarray(values).reshape(-1).tolist()
    return f'"{kind} {name}" [{_numbers(listed)}]'


class _Writer:
    """The parts of a file, and the files next to it."""

    def __init__(self, target: Path) -> None:
        self.target = target
        self.head: list[str] = []
        # In the order in which they need one another: textures, materials and media; objects; lights; shapes.
        self.named: list[str] = []
        self.objects: list[str] = []
        self.lights: list[str] = []
        self.shapes: list[str] = []
        self.images: dict[str, npt.NDArray[np.float32]] = {}
        self.meshes: dict[str, bytes] = {}
        self.rounded = 0
        self._names: dict[int, str] = {}
        # What has a name is kept, so that no other has its id.
        self._kept: list[Any] = []

    @property
    def lines(self) -> list[str]:
        return [*self.head, "WorldBegin", *self.named, *self.objects, *self.lights, *self.shapes]

    def scene(self, source: dict[str, Any], size: tuple[int, int]) -> None:
        cameras: Sequence[Camera] = source["camera"]
        if len(cameras) > 1:
            raise LumbreError(f"a .pbrt has one camera (found {len(cameras)})")
        if cameras:
            self.camera(cameras[0], size)
        elif tuple(source["up"] or ()) != (0.0, 1.0, 0.0):
            raise LumbreError("a .pbrt does not say what is up (expected a camera)")
        if not source["lights"] and not any(_shines(part) for part in source["shapes"]):
            raise LumbreError("a .pbrt without light is dark (expected a light, or a shape with emission)")
        for light in source["lights"]:
            self.light(light)
        for part in source["shapes"]:
            if isinstance(part, Instances):
                shapes = [part.shapes] if isinstance(part.shapes, Shape) else part.shapes
                name = self.object(shapes, None, None)
                for place in part._places():
                    self.shapes += ["AttributeBegin", f"  {_transform(place)}", f'  ObjectInstance "{name}"', "AttributeEnd"]
            elif isinstance(part, Shape):
                self.shapes += self.shape(part, None, None)
            else:
                raise LumbreError("a scene of files in a scene is not saved (expected its meshes: see Scene.meshes)")

    def camera(self, camera: Camera, size: tuple[int, int]) -> None:
        width, height = camera._size() or size
        if isinstance(camera, Pinhole):
            place = rigid("pose", camera.pose)
            if camera.axes == "opencv":
                place = place @ np.diag([1.0, -1.0, -1.0, 1.0])
            # The space of a camera is left-handed: its z goes forwards.
            self.head.append(_transform(np.linalg.inv(place @ np.diag([1.0, 1.0, -1.0, 1.0]))))
            window = (-camera.cx / camera.fx, (width - camera.cx) / camera.fx, (camera.cy - height) / camera.fy, camera.cy / camera.fy)
            kind = f'"perspective" "float fov" 90 {_param("float", "screenwindow", window)}'
        elif isinstance(camera, (Perspective, Orthographic)):
            eye, target, up = camera._view()
            # pbrt's view of a right-handed world is mirrored.
            self.head += ["Scale -1 1 1", f"LookAt {_numbers(eye)}  {_numbers(target)}  {_numbers(up)}"]
            if isinstance(camera, Perspective):
                kind = f'"perspective" {_param("float", "fov", camera.fov)}'
                if camera.lens_radius > 0:
                    distance = _param("float", "focaldistance", math.dist(eye, target))
                    kind += f" {_param('float', 'lensradius', camera.lens_radius)} {distance}"
            else:
                # The window is 2 high, or wide, along the shorter side of any picture.
                factor = _number(2 / camera.height)
                self.head.insert(0, f"Scale {factor} {factor} 1")
                kind = '"orthographic"'
        else:
            raise LumbreError(f"a camera of type {type(camera).__name__} is not saved (expected Perspective, Orthographic or Pinhole)")
        film = f'Film "rgb" {_param("integer", "xresolution", width)} {_param("integer", "yresolution", height)}'
        self.head += [f"Camera {kind}", film]

    def light(self, light: Light) -> None:
        if isinstance(light, PointLight):
            values = _param("rgb", "I", colour("intensity", light.intensity))
            self.lights.append(f'LightSource "point" {_param("point3", "from", tuple(light.position))} {values}')
        elif isinstance(light, SpotLight):
            ends = f"{_param('point3', 'from', tuple(light.position))} {_param('point3', 'to', tuple(light.target))}"
            cone = f"{_param('float', 'coneangle', light.angle)} {_param('float', 'conedeltaangle', light.falloff)}"
            self.lights.append(f'LightSource "spot" {ends} {cone} {_param("rgb", "I", colour("intensity", light.intensity))}')
        elif isinstance(light, (DistantLight, SunLight)):
            if isinstance(light, SunLight) and light.elevation <= 0:
                return
            if isinstance(light, SunLight) and light.irradiance is None:
                place = f"{_param('float', 'azimuth', light.azimuth)} {_param('float', 'elevation', light.elevation)}"
                air = f"{_param('float', 'turbidity', light.turbidity)} {_param('float', 'sunangle', light.angle)}"
                self.lights.append(f'LightSource "sky" {place} {air} "float skyscale" 0')
                return
            assert light.irradiance is not None
            values = _param("rgb", "L", colour("irradiance", light.irradiance))
            if isinstance(light, SunLight) and light.angle > 0:
                values += f" {_param('float', 'angle', light.angle)}"
            self.lights.append(f'LightSource "distant" {_param("point3", "from", tuple(light.towards))} "point3 to" [0 0 0] {values}')
        elif isinstance(light, (EnvironmentLight, SkyLight)):
            self.environment(light)
        else:
            raise LumbreError(f"a light of type {type(light).__name__} is not saved")

    def environment(self, light: EnvironmentLight | SkyLight) -> None:
        factor = (1.0, 1.0, 1.0) if isinstance(light, SkyLight) else colour("radiance", light.radiance)
        pixels = light._map() if isinstance(light, SkyLight) else None if light.image is None else np.asarray(light.image)
        if pixels is None:
            self.lights.append(f'LightSource "infinite" {_param("rgb", "L", factor)}')
            return
        if isinstance(light, EnvironmentLight) and tuple(light.up) != (0.0, 0.0, 1.0):
            raise LumbreError(f"an EnvironmentLight with an image is saved with z up (found up {light.up})")
        if not factor[0] == factor[1] == factor[2]:
            raise LumbreError(f"an EnvironmentLight with an image is saved with a grey radiance (found {factor})")
        name = self.image(np.asarray(pixels, dtype=np.float32))
        line = f'LightSource "infinite" {_param("string", "filename", name)} {_param("float", "scale", factor[0])}'
        if pixels.shape[0] == pixels.shape[1]:
            self.lights.append(line)
            return
        # Here x is in the middle of a wide map, in files it is at its edges.
        self.lights += ["AttributeBegin", "  Rotate 180 0 0 1", f"  {line}", "AttributeEnd"]

    def image(self, pixels: npt.NDArray[np.float32]) -> str:
        name = f"{self.target.stem}-{len(self.images)}.pfm"
        self.images[name] = pixels
        return name

    def object(self, shapes: Sequence[Shape], material: Material | None, emission: Any) -> str:
        # Objects in it come before it.
        body = [line for shape in shapes for line in self.shape(shape, material, emission)]
        name = f"object {sum(line.startswith('ObjectBegin') for line in self.objects)}"
        self.objects += [f'ObjectBegin "{name}"', *(f"  {line}" for line in body), "ObjectEnd"]
        return name

    def shape(self, shape: Shape, material: Material | None, emission: Any) -> list[str]:
        """The lines of a shape; material and emission are those of the CSG that it is in."""
        own: Any = shape.material if shape.material is not None else material
        light = shape._light() if shape._light() is not None else emission
        lines = ["AttributeBegin"]
        if shape.transform is not None:
            lines.append("  " + _transform(np.asarray(shape.transform, dtype=np.float64)))
        if shape.medium is not None:
            lines.append(f'  MediumInterface "{self.medium(shape.medium)}" ""')
        if isinstance(shape, _Csg):
            operands = [_listed(operand) for operand in shape.operands]
            names = " ".join(f'"{self.object(operand, own, light)}"' for operand in operands)
            lines.append(f'  Shape "csg" {_param("string", "operation", shape._operation)} "string operands" [{names}]')
        else:
            if own is None and shape.medium is not None:
                lines.append('  Material "interface"')
            else:
                lines.append(f'  NamedMaterial "{self.material(own if own is not None else Diffuse(0.5))}"')
            if light is not None:
                lines.append(f'  AreaLightSource "diffuse" {_param("rgb", "L", light)}')
            lines.append("  " + self.geometry(shape))
        return [*lines, "AttributeEnd"]

    def geometry(self, shape: Shape) -> str:
        def with_params(kind: str, *params: tuple[str, str, Any]) -> str:
            return " ".join([f'Shape "{kind}"', *(_param(*param) for param in params)])

        def point(name: str, ours: str = "") -> tuple[str, str, Any]:
            return "point3", name, tuple(getattr(shape, ours or name))

        def number(name: str, ours: str = "") -> tuple[str, str, Any]:
            return "float", name, getattr(shape, ours or name)

        if isinstance(shape, Sphere):
            return with_params("sphere", point("center"), number("radius"))
        if isinstance(shape, Plane):
            return with_params("plane", point("point"), ("normal", "normal", tuple(shape.normal)))
        if isinstance(shape, Disk):
            normal = ("normal", "normal", tuple(shape.normal))
            return with_params("disk", point("center"), normal, number("radius"), number("innerradius", "inner_radius"))
        if isinstance(shape, Box):
            return with_params("box", point("p0"), point("p1"))
        if isinstance(shape, Cylinder):
            return with_params("cylinder", point("p0"), point("p1"), number("radius"), ("bool", "caps", shape.caps))
        if isinstance(shape, Cone):
            radii = number("radius", "r0"), number("topradius", "r1")
            return with_params("cone", point("p0"), point("p1"), *radii, ("bool", "caps", shape.caps))
        if isinstance(shape, Capsule):
            return with_params("capsule", point("p0"), point("p1"), number("radius"))
        if isinstance(shape, Torus):
            axis = ("vector3", "axis", tuple(shape.axis))
            return with_params("torus", point("center"), axis, number("majorradius", "major"), number("minorradius", "minor"))
        if isinstance(shape, Paraboloid):
            return with_params("paraboloid", number("radius"), number("zmin"), number("zmax"), number("phimax"))
        if isinstance(shape, Hyperboloid):
            return with_params("hyperboloid", point("p1"), point("p2"), number("phimax"))
        if isinstance(shape, Quadric):
            clip = () if shape.clip is None else (("point3", "p0", tuple(shape.clip[0])), ("point3", "p1", tuple(shape.clip[1])))
            return with_params("quadric", ("float", "coefficients", tuple(shape.coefficients)), *clip)
        if isinstance(shape, Triangle):
            return with_params("triangle", point("p0"), point("p1"), point("p2"))
        if isinstance(shape, Mesh):
            return with_params("plymesh", ("string", "filename", self.mesh(shape)))
        if isinstance(shape, Curves):
            raise LumbreError("Curves are not saved: a .pbrt has a width at the ends of each, not at each point")
        if isinstance(shape, (Patch, AreaLight)):
            raise LumbreError(f"a shape of type {type(shape).__name__} is not saved: a .pbrt has patches in single precision")
        raise LumbreError(f"a shape of type {type(shape).__name__} is not saved: a .pbrt has no such shape")

    def mesh(self, mesh: Mesh) -> str:
        """A binary PLY next to the file, in single precision."""
        if mesh.colors is not None:
            raise LumbreError("a Mesh with colors is not saved: a .pbrt has no colours of vertices")
        vertices = mesh.vertices.astype(np.float32)
        self.rounded += int((vertices != mesh.vertices).any(axis=1).sum())
        columns = [vertices]
        names = ["x", "y", "z"]
        if mesh.normals is not None:
            columns.append(mesh.normals.astype(np.float32))
            names += ["nx", "ny", "nz"]
        if mesh.uvs is not None:
            columns.append(mesh.uvs.astype(np.float32))
            names += ["u", "v"]
        corners = mesh.faces.shape[1]
        head = ["ply", "format binary_little_endian 1.0", f"element vertex {len(vertices)}"]
        head += [f"property float {name}" for name in names]
        head += [f"element face {len(mesh.faces)}", "property list uchar int vertex_indices", "end_header", ""]
        faces = np.empty(len(mesh.faces), dtype=[("count", "u1"), ("corners", "<i4", (corners,))])
        faces["count"], faces["corners"] = corners, mesh.faces
        name = f"{self.target.stem}-{len(self.meshes)}.ply"
        self.meshes[name] = "\n".join(head).encode() + np.hstack(columns).astype("<f4").tobytes() + faces.tobytes()
        return name

    def new_name(self, what: Any, noun: str) -> str:
        name = f"{noun} {len(self._names)}"
        self._names[id(what)] = name
        self._kept.append(what)
        return name

    def medium(self, medium: Medium) -> str:
        if id(medium) not in self._names:
            coefficients = (("sigma_a", "absorption"), ("sigma_s", "scattering"), ("Le", "emission"))
            params = [_param("rgb", name, colour(ours, getattr(medium, ours))) for name, ours in coefficients]
            params.append(_param("float", "g", medium.asymmetry))
            name = self.new_name(medium, "medium")
            self.named.append(f'MakeNamedMedium "{name}" "string type" "homogeneous" {" ".join(params)}')
        return self._names[id(medium)]

    def texture(self, texture: Texture, is_colour: bool) -> str:
        """The name of a texture, whose image is written in linear light."""
        if texture.wrap == "mirror":
            raise LumbreError('a Texture with wrap="mirror" is not saved: a .pbrt has repeat, clamp and black')
        texels = np.asarray(texture.image)
        texels = texels if texels.ndim == 3 else texels[..., None]
        if texels.shape[2] not in (1, 3):
            raise LumbreError(f"a Texture is saved with 1 or 3 channels (found {texels.shape[2]})")
        is_whole = texels.dtype in (np.uint8, np.uint16)
        light = texels.astype(np.float64) / (np.iinfo(texels.dtype).max if is_whole else 1)
        if texture.encoding == "srgb" or (texture.encoding == "auto" and is_whole and is_colour):
            light = np.where(light <= 0.04045, light / 12.92, ((light + 0.055) / 1.055) ** 2.4)
        filters = {"nearest": "point", "bilinear": "bilinear", "trilinear": "trilinear", "ewa": "EWA"}
        params = [
            _param("string", "filename", self.image(np.broadcast_to(light, (*light.shape[:2], 3)).astype(np.float32))),
            _param("string", "filter", filters[texture.filter]),
            _param("string", "wrap", texture.wrap),
        ]
        places = zip(("uscale", "vscale", "udelta", "vdelta"), (*texture.scale, *texture.offset), strict=True)
        params += [_param("float", name, value) for name, value in places]
        name = f"texture {len(self.images)}"
        self.named.append(f'Texture "{name}" "{"spectrum" if is_colour else "float"}" "imagemap" {" ".join(params)}')
        return name

    def material(self, material: Material) -> str:
        if id(material) not in self._names:
            kind, params = self.kind(material)
            if material.normal_map is not None:
                raise LumbreError("a normal_map is not saved: a .pbrt reads it of a file of its own")
            if material.bump_map is not None:
                params.append(_param("texture", "displacement", self.texture(_texture(material.bump_map), False)))
            name = self.new_name(material, "material")
            self.named.append(f'MakeNamedMaterial "{name}" "string type" "{kind}" {" ".join(params)}'.rstrip())
        return self._names[id(material)]

    def kind(self, material: Material) -> tuple[str, list[str]]:
        def rgb(name: str, value: Any) -> str:
            if isinstance(value, Texture):
                return _param("texture", name, self.texture(value, True))
            return _param("rgb", name, colour(name, value))

        def number(name: str, value: Any) -> str:
            if isinstance(value, Texture):
                return _param("texture", name, self.texture(value, False))
            return _param("float", name, value)

        as_is = _param("bool", "remaproughness", False)
        if isinstance(material, Diffuse):
            return "diffuse", [rgb("reflectance", material.reflectance)]
        if isinstance(material, Metal):
            return "conductor", [rgb("reflectance", material.reflectance), number("roughness", material.roughness), as_is]
        if isinstance(material, Glass):
            return "dielectric", [number("eta", material.ior), number("roughness", material.roughness), as_is]
        if isinstance(material, ThinGlass):
            return "thindielectric", [number("eta", material.ior)]
        if isinstance(material, Coated):
            params = [rgb("reflectance", material.reflectance), number("roughness", material.roughness), as_is]
            return "coateddiffuse", [*params, number("eta", material.ior)]
        if isinstance(material, Translucent):
            return "diffusetransmission", [rgb("reflectance", material.reflectance), rgb("transmittance", material.transmittance)]
        if isinstance(material, Hair):
            colours = [number("eumelanin", material.eumelanin), number("pheomelanin", material.pheomelanin)]
            if material.color is not None:
                colours = [rgb("reflectance", material.color)]
            rest = [number("beta_m", material.roughness), number("beta_n", material.azimuthal_roughness)]
            return "hair", [*colours, *rest, number("alpha", material.tilt), number("eta", material.ior)]
        if isinstance(material, Principled):
            return "principled", self.principled(material, rgb, number)
        if isinstance(material, Mix):
            parts = " ".join(f'"{self.material(part)}"' for part in (material.first, material.second))
            return "mix", [f'"string materials" [{parts}]', number("amount", material.amount)]
        raise LumbreError(f"a material of type {type(material).__name__} is not saved")

    def principled(self, material: Principled, rgb: Callable[[str, Any], str], number: Callable[[str, Any], str]) -> list[str]:
        plain = Principled()
        for name in ("clearcoat", "clearcoat_roughness", "sheen_color", "sheen_roughness", "specular", "specular_color"):
            if getattr(material, name) != getattr(plain, name):
                raise LumbreError(f"a Principled with {name} is not saved: a .pbrt has it by another law")
        params = [
            rgb("base_color", material.base_color),
            number("metallic", material.metallic),
            number("roughness", material.roughness),
            number("spec_trans", material.transmission),
            number("eta", material.ior),
        ]
        if material.attenuation_distance is None:
            return [*params, _param("bool", "thin", True)]
        params.append(rgb("attenuation_color", material.attenuation_color))
        if math.isfinite(material.attenuation_distance):
            params.append(number("attenuation_distance", material.attenuation_distance))
        return params


def _texture(value: Any) -> Texture:
    return value if isinstance(value, Texture) else Texture(value)


def _transform(place: npt.NDArray[Any]) -> str:
    """The scene language has columns one after the other."""
    return f"Transform [{_numbers(place.T.reshape(-1).tolist())}]"


def _shines(part: Any) -> bool:
    if isinstance(part, Instances):
        return any(_shines(shape) for shape in ([part.shapes] if isinstance(part.shapes, Shape) else part.shapes))
    if isinstance(part, _Csg) and part._light() is None:
        return any(_shines(shape) for operand in part.operands for shape in _listed(operand))
    return isinstance(part, Shape) and part._light() is not None
