"""Names: common wrong names are answered with the right ones, and `help` shows what is for users."""

from __future__ import annotations

import difflib
import functools
import inspect
from collections.abc import Callable, Iterable
from typing import Any, TypeVar

_F = TypeVar("_F", bound=Callable[..., Any])

# What other libraries call it, and what it may be called here: the first that the callee has.
_SYNONYMS: dict[str, tuple[str, ...]] = {
    "samples": ("spp",),
    "num_samples": ("spp",),
    "samples_per_pixel": ("spp",),
    "width": ("size", "widths"),
    "height": ("size",),
    "resolution": ("size",),
    "res": ("size",),
    "shape": ("size",),
    "r": ("radius",),
    "rad": ("radius",),
    "inner": ("inner_radius",),
    "major_radius": ("major",),
    "minor_radius": ("minor",),
    "centre": ("center",),
    "origin": ("center", "eye", "position", "point"),
    "location": ("position", "eye", "center"),
    "pos": ("position", "eye", "center"),
    "position": ("eye", "center", "point"),
    "look_at": ("target",),
    "lookat": ("target",),
    "at": ("target", "towards"),
    "direction": ("towards", "target", "axis", "normal"),
    "color": ("reflectance", "base_color", "material", "radiance", "intensity", "irradiance"),
    "colour": ("reflectance", "base_color", "color", "material", "radiance", "intensity", "irradiance"),
    "albedo": ("reflectance", "base_color", "material"),
    "mat": ("material",),
    "emit": ("emission",),
    "emissive": ("emission",),
    "radiance": ("emission", "intensity", "irradiance"),
    "power": ("intensity", "irradiance", "radiance", "emission"),
    "strength": ("intensity", "irradiance", "radiance"),
    "eta": ("ior",),
    "metalness": ("metallic",),
    "matrix": ("transform", "pose"),
    "pose": ("transform", "camera"),
    "to_world": ("transform",),
    "extrinsics": ("pose",),
    "field_of_view": ("fov",),
    "vfov": ("fov",),
    "aperture": ("lens_radius",),
    "triangles": ("faces",),
    "indices": ("faces",),
    "verts": ("vertices",),
    "points": ("vertices", "points"),
    "uv": ("uvs",),
    "min": ("p0",),
    "max": ("p1",),
    "lower": ("p0",),
    "upper": ("p1",),
    "start": ("p0",),
    "end": ("p1",),
    "light": ("lights",),
    "cameras": ("camera",),
    "max_bounces": ("max_depth",),
    "max_bounce": ("max_depth",),
    "depth": ("max_depth", "features"),
    "aov": ("features",),
    "aovs": ("features",),
    "bg": ("background",),
    "environment": ("env",),
    "envmap": ("env",),
    "denoiser": ("denoise",),
    "alpha": ("transparent",),
    "bounds": ("p0",),
    "g": ("asymmetry",),
    "sigma_a": ("absorption",),
    "sigma_s": ("scattering",),
    "function": ("expression",),
    "f": ("expression",),
}


def our_name(word: str, known: Iterable[str]) -> str | None:
    """What a word is called here, among names that are known; None where nothing is like it."""
    names = list(known)
    for ours in _SYNONYMS.get(word.lower(), ()):
        if ours in names:
            return ours
    near = difflib.get_close_matches(word, names, n=1, cutoff=0.6)
    return near[0] if near else None


def wrong_name(callee: str, word: str, known: Iterable[str]) -> TypeError:
    """The error for an argument that is not there."""
    names = [name for name in known if not name.startswith("_")]
    ours = our_name(word, names)
    tip = "" if ours is None else f"; did you mean {ours}?"
    return TypeError(f"{callee} has no argument {word} (expected {', '.join(names)}{tip})")


def answers_names(function: _F) -> _F:
    """A function that answers arguments by wrong names with the right ones."""
    parameters = inspect.signature(function).parameters
    names = tuple(name for name in parameters if name not in ("self", "cls"))
    known = frozenset(names)
    callee = function.__qualname__.removesuffix(".__init__")

    @functools.wraps(function)
    def answered(*arguments: Any, **named: Any) -> Any:
        if not known.issuperset(named):
            raise wrong_name(callee, next(word for word in named if word not in known), names)
        return function(*arguments, **named)

    return answered  # type: ignore[return-value]


_MACHINERY = frozenset(
    {
        "__dataclass_fields__",
        "__dataclass_params__",
        "__match_args__",
        "__replace__",
        "__post_init__",
        "__setattr__",
        "__delattr__",
        "__getstate__",
        "__setstate__",
        "__annotations__",
        "__annotate_func__",
        "__annotations_cache__",
        "__static_attributes__",
        "__firstlineno__",
        "__hash__",
    }
)


class Described(type):
    """The type of shapes, materials, lights and cameras: `help` and `dir` show what is for users, and an argument by a wrong name is
    answered with the right one."""

    def __dir__(cls) -> list[str]:
        return [name for name in super().__dir__() if name not in _MACHINERY]

    @property
    def __signature__(cls) -> inspect.Signature:
        # That of the call below says nothing.
        signature = inspect.signature(cls.__init__)  # type: ignore[misc]
        return signature.replace(parameters=list(signature.parameters.values())[1:])

    def __call__(cls, *arguments: Any, **named: Any) -> Any:
        if named:
            known = cls.__dict__.get("_arguments")
            if known is None:
                parameters = cls.__signature__.parameters.values()
                known = tuple(each.name for each in parameters if each.kind is not inspect.Parameter.VAR_POSITIONAL)
                # Once for each class.
                type.__setattr__(cls, "_arguments", known)
            for word in named:
                if word not in known:
                    raise wrong_name(cls.__name__, word, known)
        return super().__call__(*arguments, **named)


def no_attribute(owner: object, name: str, hints: dict[str, str]) -> AttributeError:
    """The error for an attribute that is not there, with what is there in its place."""
    kind = type(owner).__name__
    if name in hints:
        return AttributeError(f"{kind} has no {name}: {hints[name]}")
    known = [known for known in dir(type(owner)) if not known.startswith("_")]
    ours = our_name(name, known)
    tip = "" if ours is None else f"; did you mean {ours}?"
    return AttributeError(f"{kind} has no {name} (expected {', '.join(known)}{tip})")
