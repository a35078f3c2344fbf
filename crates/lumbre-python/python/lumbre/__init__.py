"""Exact ray queries for numpy arrays, and pictures.

>>> import lumbre, numpy as np
>>> scene = lumbre.Scene([lumbre.Sphere(center=(0, 0, 3), radius=2)])
>>> hits = scene.cast(np.zeros((1, 3)), np.array([[0.0, 0.0, 1.0]]))
>>> float(hits.t[0]), hits.normal[0].tolist()
(1.0, [0.0, 0.0, -1.0])
"""

from __future__ import annotations

from ._lumbre import LumbreError, thread_count
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
    Metal,
    Mix,
    Orthographic,
    Panorama,
    Perspective,
    PointLight,
    Principled,
    SpotLight,
    Texture,
    ThinGlass,
    Translucent,
)
from .explanation import Explanation
from .geometry import (
    Box,
    Capsule,
    Cone,
    Curves,
    Cylinder,
    Difference,
    Disk,
    Hyperboloid,
    Instances,
    Intersection,
    Mesh,
    Paraboloid,
    Patch,
    Plane,
    Quadric,
    Shape,
    Sphere,
    Torus,
    Triangle,
    Union,
)
from .image import Image, read_image, write_image
from .scene import AllHits, Hits, Nearest, Scene, load
from .viewing import Viewer

__version__ = "0.1.0"

__all__ = [
    "AllHits",
    "Box",
    "Camera",
    "Capsule",
    "Coated",
    "Cone",
    "Curves",
    "Cylinder",
    "Difference",
    "Diffuse",
    "Disk",
    "DistantLight",
    "EnvironmentLight",
    "Explanation",
    "Glass",
    "Hair",
    "Hits",
    "Hyperboloid",
    "Image",
    "Instances",
    "Intersection",
    "Light",
    "LumbreError",
    "Material",
    "Mesh",
    "Metal",
    "Mix",
    "Nearest",
    "Orthographic",
    "Panorama",
    "Paraboloid",
    "Patch",
    "Perspective",
    "Plane",
    "PointLight",
    "Principled",
    "Quadric",
    "Scene",
    "Shape",
    "Sphere",
    "SpotLight",
    "Texture",
    "ThinGlass",
    "Torus",
    "Translucent",
    "Triangle",
    "Union",
    "Viewer",
    "load",
    "read_image",
    "thread_count",
    "write_image",
]
