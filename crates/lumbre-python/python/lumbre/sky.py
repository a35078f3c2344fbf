"""Where the sun stands."""

from __future__ import annotations

import datetime
import math
from typing import Any

import numpy as np

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
