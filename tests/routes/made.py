"""Texts of routes and helpers that several tests share."""

import numpy as np
import pytest

from tripwatt.errors import InvalidInput
from tripwatt.routes.points import haversine_m

NO = np.nan

TO_ROUNDING = {"rtol": 1e-12, "atol": 1e-9}

M_PER_DEGREE = float(haversine_m([48.0, 49.0], [11.0, 11.0])[0])

SPEED = np.concatenate(
    (
        np.linspace(0, 15, 20),
        np.full(100, 15.0),
        np.linspace(15, 0, 12),
        np.zeros(20),
        np.linspace(0, 12, 15),
        np.full(90, 12.0),
    )
)
"""Speed of a drive with one stop [m/s], once a second."""


def faults_of(call, *arguments, **options):
    """The faults with which a call refuses its input."""
    with pytest.raises(InvalidInput) as caught:
        call(*arguments, **options)
    return caught.value.faults


def gpx(points, tag="trkpt", head="<?xml version='1.0' encoding='UTF-8'?>\n"):
    """A GPX text of (latitude, longitude, elevation or None, time or None)."""
    body = "".join(
        f'<{tag} lat="{lat:.9f}" lon="{lon:.9f}">'
        + ("" if ele is None else f"<ele>{ele}</ele>")
        + ("" if time is None else f"<time>{time}</time>")
        + f"</{tag}>"
        for lat, lon, ele, time in points
    )
    inner = f"<trk><trkseg>{body}</trkseg></trk>" if tag == "trkpt" else f"<rte>{body}</rte>"
    return f'{head}<gpx version="1.1" xmlns="http://www.topografix.com/GPX/1/1">{inner}</gpx>'.encode()


def drive(speed, elevation=None, every_s=1):
    """GPX points of a drive due north, one every so many seconds."""
    position = np.concatenate(([0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1]))))
    return [
        (
            48.0 + position[k] / M_PER_DEGREE,
            11.0,
            None if elevation is None else elevation[k],
            f"2026-05-01T{8 + k // 3600:02d}:{k // 60 % 60:02d}:{k % 60:02d}Z",
        )
        for k in range(0, len(speed), every_s)
    ]


def encode_polyline(points, scales):
    """An encoded polyline, written the other way round than the reader."""
    text, before = "", np.zeros(len(scales), dtype=np.int64)
    for point in np.rint(np.asarray(points) * scales).astype(np.int64):
        for delta in (point - before).tolist():
            value = ~(delta << 1) if delta < 0 else delta << 1
            while value >= 0x20:
                text += chr((0x20 | (value & 0x1F)) + 63)
                value >>= 5
            text += chr(value + 63)
        before = point
    return text
