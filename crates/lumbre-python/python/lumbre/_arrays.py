"""Arrays as the native half takes them."""

from __future__ import annotations

import math
import operator
from collections.abc import Iterable
from typing import Any

import numpy as np
import numpy.typing as npt

from ._lumbre import LumbreError, memory_left

Array = npt.NDArray[Any]
Triple = tuple[float, float, float]

_SINGLE = np.dtype(np.float32)
_DOUBLE = np.dtype(np.float64)
# Half of what a small machine has.
_LITTLE = 1 << 28


def triple(name: str, value: Iterable[float]) -> Triple:
    """Three numbers."""
    try:
        x, y, z = (float(number) for number in value)
    except (TypeError, ValueError) as error:
        raise LumbreError(f"{name} is no triple (found {value!r}; expected three numbers)") from error
    return x, y, z


def array_of(name: str, value: npt.ArrayLike) -> Array:
    """An array of numbers. One whose values are masked is refused, for what is behind a mask would count."""
    if isinstance(value, np.ma.MaskedArray):
        if np.ma.getmaskarray(value).any():
            raise LumbreError(f"{name} has masked values (expected an array without, such as value.filled(0) or value.compressed())")
        value = value.data
    return np.asarray(value)


def whole(name: str, value: Any, low: int = 0, high: int = 2**32 - 1) -> int:
    """A whole number from low to high."""
    try:
        number = None if isinstance(value, (bool, np.bool_)) else operator.index(value)
    except TypeError:
        number = None
    if number is None or not low <= number <= high:
        raise LumbreError(f"{name} is out of range (found {value!r}; expected a whole number from {low} to {high})")
    return number


def wholes(name: str, value: Any, names: str, low: int = 0) -> tuple[int, ...]:
    """Whole numbers, one for each of these names."""
    count = len(names.split(", "))
    is_list = isinstance(value, (tuple, list, np.ndarray)) and np.ndim(value) == 1
    if not is_list or len(value) != count:
        raise LumbreError(f"{name} is out of range (found {value!r}; expected ({names}), {count} whole numbers)")
    return tuple(whole(name, number, low) for number in value)


def positive(name: str, value: Any, unit: str = "a number above 0") -> float:
    """A finite number above 0."""
    is_number = isinstance(value, (int, float, np.integer, np.floating)) and not isinstance(value, bool)
    if not is_number or not 0 < value < math.inf:
        raise LumbreError(f"{name} is out of range (found {value!r}; expected {unit})")
    return float(value)


def flag(name: str, value: Any) -> bool:
    """True or False."""
    if not isinstance(value, (bool, np.bool_)):
        raise LumbreError(f"{name} is neither True nor False (found {value!r})")
    return bool(value)


def fits(what: str, nbytes: int) -> None:
    """Raises `MemoryError` for what does not fit into the memory that is left. Little is not asked about."""
    if nbytes > _LITTLE and nbytes > (left := memory_left()):
        raise MemoryError(f"{what}: needs {nbytes} bytes of memory, {left} are left")


def real(array: Array) -> Array:
    """The array itself where it is of single or double precision and of this machine's byte order, else in double precision."""
    dtype = array.dtype
    if (dtype == _DOUBLE or dtype == _SINGLE) and dtype.isnative and array.flags.aligned:
        return array
    if dtype.kind not in "fiub":
        raise LumbreError(f"an array is of the wrong kind (found {dtype}; expected real numbers)")
    return array.astype(_SINGLE if dtype == _SINGLE.newbyteorder() else _DOUBLE)


def rows(name: str, value: npt.ArrayLike) -> Array:
    """An (N, 3) array, or a single triple."""
    array = real(array_of(name, value))
    if array.ndim in (1, 2) and array.shape[-1] == 3:
        return array
    if array.size == 0 and array.ndim <= 2:
        return array.reshape(0, 3)
    raise LumbreError(f"{name} has the wrong shape (found {array.shape}; expected (N, 3))")


def rays(
    origins: npt.ArrayLike, directions: npt.ArrayLike, tmin: npt.ArrayLike, tmax: npt.ArrayLike
) -> tuple[Array, Array, float | Array, float | Array]:
    """Rays of one precision: single where all that is given for each ray is, else double. A single triple is for all rays."""
    o, d = rows("origins", origins), rows("directions", directions)
    if o.ndim == 1 or d.ndim == 1:
        count = len(d) if d.ndim == 2 else len(o) if o.ndim == 2 else 1
        o, d = np.broadcast_to(o, (count, 3)), np.broadcast_to(d, (count, 3))
    low = limit("tmin", tmin)
    high = limit("tmax", tmax)
    if o.dtype != d.dtype:
        o, d = o.astype(_DOUBLE, copy=False), d.astype(_DOUBLE, copy=False)
    if isinstance(low, np.ndarray):
        low = low.astype(o.dtype, copy=False)
    if isinstance(high, np.ndarray):
        high = high.astype(o.dtype, copy=False)
    return o, d, low, high


def limit(name: str, value: npt.ArrayLike) -> float | Array:
    """One number for all rays, or one for each."""
    if isinstance(value, (int, float)):
        return float(value)
    array = real(array_of(name, value))
    if array.ndim == 0:
        return float(array)
    if array.ndim == 1:
        return array
    raise LumbreError(f"{name} has the wrong shape (found {array.shape}; expected a number or (N,))")
