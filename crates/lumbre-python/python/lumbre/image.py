"""Pictures."""

from __future__ import annotations

import os
from collections.abc import Sequence
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from . import _lumbre
from ._arrays import array_of
from ._lumbre import LumbreError
from ._words import no_attribute


class Image:
    """A rendered picture: an array of linear light, which shows itself in a notebook.

    `numpy.asarray(image)` is `image.array`. Pickles keep all but what a denoised picture was before, and the part of a distributed one.

    >>> import lumbre, numpy as np
    >>> image = lumbre.Scene([lumbre.Sphere()]).render(spp=1, size=(8, 6), features=True)
    >>> np.asarray(image).shape, image.feature("depth").shape
    ((6, 8, 3), (6, 8))
    """

    def __init__(self, native: _lumbre.Picture) -> None:
        self._native = native
        self._stats: dict[str, Any] | None = None

    def __getattr__(self, name: str) -> Any:
        raise no_attribute(self, name, _HINTS)

    @cached_property
    def array(self) -> npt.NDArray[np.float32]:
        """Linear light, (h, w, 3), float32, the first row at the top."""
        return self._native.pixels()

    @cached_property
    def alpha(self) -> npt.NDArray[np.float32] | None:
        """Coverage in [0, 1], (h, w), of a picture that was rendered with `transparent`, else None."""
        return self._native.alpha()

    @property
    def shape(self) -> tuple[int, ...]:
        """That of `array`."""
        return self.array.shape

    def feature(self, name: str) -> npt.NDArray[np.float32]:
        """An AOV: albedo (h, w, 3), normal (h, w, 3), depth (h, w) along the camera's axis, or uv (h, w, 2).

        Each is the mean of what the samples of a pixel met. Where they met nothing, depth is inf, and the others are 0.

        Raises `LumbreError` where the picture was rendered without `features`.

        >>> import lumbre
        >>> image = lumbre.Scene([lumbre.Sphere()]).render(spp=1, size=(9, 9), features=True, ground="none")
        >>> depth = image.feature("depth")
        >>> bool(depth[4, 4] > 0), float(depth[0, 0])
        (True, inf)
        """
        found = self._native.feature(name)
        if found is None:
            raise LumbreError(f"the {name} layer was not rendered (expected features=True)")
        array, channels = found
        if name == "depth":
            # Nothing that is seen is at the camera itself.
            array = np.where(array == 0, np.float32(np.inf), array)
        return array[..., 0] if channels == 1 else array[..., :channels]

    @cached_property
    def channels(self) -> dict[str, npt.NDArray[np.float32]]:
        """The channels of the scene's film besides colours, (h, w) each, by pbrt's names: of `gbuffer`, such as "P.X", and of `spectral`,
        such as "S0.400,000000nm". An .exr file holds them, too. Empty for other films.

        >>> import lumbre
        >>> lumbre.Scene([lumbre.Sphere()]).render(spp=1, size=(8, 6)).channels
        {}
        """
        return self._native.film()

    @property
    def stats(self) -> dict[str, Any]:
        """spp, most_spp, samples, rays, dropped, clamped, noise, noise_target, noise_target_met, noisy_pixels, threads, seconds."""
        return self._native.stats() if self._stats is None else dict(self._stats)

    def save(
        self,
        path: str | os.PathLike[str],
        *,
        layers: Sequence[str] = (),
        tonemap: str | None = None,
        exposure: float | None = None,
        depth: int = 8,
        quality: int = 95,
        precision: str | None = None,
    ) -> None:
        """Writes a file by its extension: .exr, .png, .jpg, .webp, .qoi, .hdr or .pfm. The path holds the old file or the whole new one.

        Parameters
        ----------
        layers : features to write with the picture, in an .exr
        tonemap : none, agx, aces or neutral, for .png and .jpg; exposure is in stops before it
            By default as the program has them: neutral in the light of its studio, else none; and no stops, unless the lights of a glTF
            would make its picture white or black.
        depth : 8 or 16 bits, of a .png
        quality : 1 to 100, of a .jpg
        precision : half or float, of an .exr; by default what the scene says, else half

        Raises `LumbreError` for options out of range, and `OSError` for a file that cannot be written.
        """
        self._native.save(os.fspath(path), list(layers), tonemap, exposure, depth, quality, precision)

    def png(self, *, tonemap: str | None = None, exposure: float | None = None) -> bytes:
        """The bytes of a .png; options as of `save`."""
        return self._native.png(tonemap, exposure)

    def __array__(self, dtype: npt.DTypeLike | None = None, copy: bool | None = None) -> npt.NDArray[Any]:
        wants_copy = copy or (dtype is not None and np.dtype(dtype) != self.array.dtype)
        if not wants_copy:
            return self.array
        if copy is False:
            raise ValueError("another dtype needs a copy")
        return np.array(self.array, dtype=dtype)

    def __reduce__(self) -> tuple[Any, ...]:
        # As it was rendered, before exposure and tone mapping.
        return _restored, (self._native.kept(), self.stats)

    def __repr__(self) -> str:
        height, width = self.array.shape[:2]
        return f"<lumbre.Image {width} x {height}, {self.stats['spp']} samples a pixel>"

    def _repr_png_(self) -> bytes:
        return self.png()


_HINTS = {
    "show": "it shows itself in a notebook; save(path) writes a file",
    "to_pil": "PIL.Image.open(io.BytesIO(image.png())) is one",
    "to_numpy": "array is its numpy array",
    "numpy": "array is its numpy array",
    "data": "array is its numpy array",
    "pixels": "array is its numpy array",
    "size": "shape is (height, width, 3)",
    "width": "shape is (height, width, 3)",
    "height": "shape is (height, width, 3)",
    "depth": 'feature("depth") of a picture that was rendered with features=True',
    "normal": 'feature("normal") of a picture that was rendered with features=True',
    "normals": 'feature("normal") of a picture that was rendered with features=True',
    "albedo": 'feature("albedo") of a picture that was rendered with features=True',
    "write": "save(path) writes a file",
}


def _restored(kept: dict[str, Any], stats: dict[str, Any]) -> Image:
    image = Image(_lumbre.Picture.restored(kept))
    image._stats = stats
    return image


def read_image(path: str | os.PathLike[str]) -> npt.NDArray[np.float32]:
    """An image file as linear light, (h, w, 3), or (h, w, 4) with its alpha: EXR, PNG, HDR, PFM, JPEG, TGA, BMP or QOI.

    Raises `LumbreError` for what is wrong with it, and `OSError` where it cannot be read.
    """
    pixels, alpha = _lumbre.read_image(os.fspath(path))
    return pixels if alpha is None else np.dstack((pixels, alpha))


def write_image(path: str | os.PathLike[str], pixels: npt.ArrayLike, *, tonemap: str = "none", exposure: float = 0.0) -> None:
    """Writes linear light, (h, w, 3) or (h, w) for grey, as an image file: .exr, .png, .jpg, .webp, .qoi, .hdr or .pfm.

    `tonemap` and `exposure` are as of `Image.save`.

    >>> import numpy as np, pathlib, tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = pathlib.Path(folder, "grey.pfm")
    ...     write_image(path, np.full((2, 3), 0.5))
    ...     read_image(path).shape
    (2, 3, 3)
    """
    array = array_of("an image", pixels).astype(np.float32, copy=False)
    if array.ndim == 2:
        array = np.repeat(array[..., None], 3, axis=-1)
    if array.ndim != 3:
        raise LumbreError(f"an image has the wrong shape (found {array.shape}; expected (h, w, 3) or (h, w))")
    _lumbre.write_image(os.fspath(path), array, tonemap, exposure)
