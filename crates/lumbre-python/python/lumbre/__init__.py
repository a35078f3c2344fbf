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
    Diffuse,
    DistantLight,
    EnvironmentLight,
    Glass,
    Light,
    Material,
    Metal,
    Orthographic,
    Panorama,
    Perspective,
    PointLight,
    Principled,
)
from .geometry import (
    Box,
    Capsule,
    Cone,
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
)
from .image import Image, read_image, write_image
from .scene import AllHits, Hits, Nearest, Scene, load

__version__ = "0.1.0"

__all__ = [
    "AllHits",
    "Box",
    "Camera",
    "Capsule",
    "Cone",
    "Cylinder",
    "Diffuse",
    "Disk",
    "DistantLight",
    "EnvironmentLight",
    "Glass",
    "Hits",
    "Hyperboloid",
    "Image",
    "Instances",
    "Light",
    "LumbreError",
    "Material",
    "Mesh",
    "Metal",
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
    "Torus",
    "Triangle",
    "load",
    "read_image",
    "thread_count",
    "write_image",
]
