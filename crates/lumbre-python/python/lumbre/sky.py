"""The sun and the sky: where the sun stands, and how bright a clear sky is."""

from __future__ import annotations

import datetime
import math
from typing import Any

import numpy as np
import numpy.typing as npt

from ._arrays import Triple
from ._lumbre import LumbreError


def sun_direction(azimuth: float, elevation: float) -> Triple:
    """The unit vector towards an azimuth in degrees clockwise from north (y; east is x), and an elevation in degrees above the horizon
    (z is up).

    >>> [round(c, 6) + 0.0 for c in sun_direction(90, 0)]
    [1.0, 0.0, 0.0]
    """
    for name, value in (("azimuth", azimuth), ("elevation", elevation)):
        if not isinstance(value, (int, float, np.integer, np.floating)) or not math.isfinite(value):
            raise LumbreError(f"{name} is out of range (found {value!r}; expected degrees)")
    a, e = math.radians(azimuth), math.radians(elevation)
    return math.sin(a) * math.cos(e), math.cos(a) * math.cos(e), math.sin(e)


def solar_position(when: Any, latitude: float, longitude: float) -> tuple[Any, Any]:
    """Where the sun stands: its azimuth in degrees clockwise from north, and its elevation in degrees above the horizon, unrefracted.

    Parameters
    ----------
    when : datetime, with its time zone, or an array of numpy's datetime64, in UTC
    latitude, longitude : degrees, to the north and to the east

    Right to about 0.01 degrees from 1950 to 2050: J. Meeus, "Astronomical Algorithms", 1998, chapters 12, 13 and 25 (low accuracy).
    Numbers for one time, arrays for several.

    >>> import datetime
    >>> noon = datetime.datetime(2026, 6, 21, 12, 0, tzinfo=datetime.timezone.utc)
    >>> azimuth, elevation = solar_position(noon, 0.0, 0.0)
    >>> round(elevation)
    67
    """
    if isinstance(when, datetime.datetime):
        if when.tzinfo is None:
            raise LumbreError("when has no time zone (expected one, such as tzinfo=datetime.timezone.utc)")
        utc = when.astimezone(datetime.timezone.utc).replace(tzinfo=None)
        times = np.array(utc, dtype="datetime64[us]")
    else:
        times = np.asarray(when)
        if times.dtype.kind != "M":
            raise LumbreError(f"when is no time (found {when!r}; expected a datetime, or an array of datetime64 in UTC)")
    for name, value, most in (("latitude", latitude, 90), ("longitude", longitude, 360)):
        if not isinstance(value, (int, float, np.integer, np.floating)) or not abs(value) <= most:
            raise LumbreError(f"{name} is out of range (found {value!r}; expected degrees from -{most} to {most})")
    # Days since noon of 2000-01-01.
    days = (times - np.datetime64("2000-01-01T12:00:00")) / np.timedelta64(1, "us") / 86400e6
    century = days / 36525
    mean_longitude = 280.46646 + century * (36000.76983 + century * 0.0003032)
    anomaly = np.radians(357.52911 + century * (35999.05029 - 0.0001537 * century))
    center = (
        (1.914602 - century * (0.004817 + 0.000014 * century)) * np.sin(anomaly)
        + (0.019993 - 0.000101 * century) * np.sin(2 * anomaly)
        + 0.000289 * np.sin(3 * anomaly)
    )
    node = np.radians(125.04 - 1934.136 * century)
    apparent = np.radians(mean_longitude + center - 0.00569 - 0.00478 * np.sin(node))
    tilt = np.radians(23.439291 - 0.0130042 * century + 0.00256 * np.cos(node))
    ascension = np.arctan2(np.cos(tilt) * np.sin(apparent), np.cos(apparent))
    declination = np.arcsin(np.sin(tilt) * np.sin(apparent))
    sidereal = 280.46061837 + 360.98564736629 * days + 0.000387933 * century**2
    hour = np.radians(sidereal + longitude) - ascension
    phi = math.radians(latitude)
    elevation = np.arcsin(np.sin(phi) * np.sin(declination) + np.cos(phi) * np.cos(declination) * np.cos(hour))
    south = np.arctan2(np.sin(hour), np.cos(hour) * np.sin(phi) - np.tan(declination) * np.cos(phi))
    azimuth, height = (np.degrees(south) + 180) % 360, np.degrees(elevation)
    return (float(azimuth), float(height)) if times.ndim == 0 else (azimuth, height)


def clear_sky(sun: Triple, zenith: npt.NDArray[np.float64], height: int = 128) -> npt.NDArray[np.float32]:
    """A clear sky as a map by longitude and latitude, (height, 2 height, 3)."""
    latitude = np.pi * (0.5 - (np.arange(height) + 0.5) / height)[:, None]
    # The centre is towards x, and three quarters of the width towards y.
    longitude = 2 * np.pi * ((np.arange(2 * height) + 0.5) / (2 * height) - 0.5)[None, :]
    x, y = np.cos(latitude) * np.cos(longitude), np.cos(latitude) * np.sin(longitude)
    z = np.broadcast_to(np.sin(latitude), x.shape)
    away = np.arccos(np.clip(x * sun[0] + y * sun[1] + z * sun[2], -1, 1))
    # CIE S 011/E:2003, type 12: gradation by the zenith angle, and indicatrix by the angle from the sun.
    a, b, c, d, e = -1.0, -0.32, 10.0, -3.0, 0.45

    def gradation(cosine: npt.ArrayLike) -> Any:
        return 1 + a * np.exp(b / np.maximum(cosine, 0.01))

    def indicatrix(angle: npt.ArrayLike) -> Any:
        return 1 + c * (np.exp(d * np.asarray(angle)) - math.exp(d * math.pi / 2)) + e * np.cos(angle) ** 2

    to_zenith = math.acos(max(-1.0, min(1.0, sun[2])))
    level = gradation(z) * indicatrix(away) / (gradation(1.0) * indicatrix(to_zenith))
    # Blue of Rayleigh's law, less of it where light comes a long way or by large angles forwards.
    white = np.clip(np.exp(-6 * np.maximum(z, 0)) + 0.6 * np.exp(-3 * away), 0, 1)[..., None]
    blue = np.array([0.45, 0.85, 1.7])
    sky = level[..., None] * (white + (1 - white) * blue) * zenith
    is_up = (z > 0)[..., None]
    # Light from below: the mean of the sky, weighed by the cosine, off ground of reflectance 0.2.
    weight = np.where(z > 0, z, 0) * np.cos(latitude)
    below = 0.2 * (sky * weight[..., None]).sum(axis=(0, 1)) / weight.sum()
    whole: npt.NDArray[np.float32] = np.where(is_up, sky, below).astype(np.float32)
    return whole
