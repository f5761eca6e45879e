"""Damaged uploads: what is still a route or a trip may be answered, everything else is a problem document, never a 5xx.

What an upload was read as is then forecast, so that numbers which a reader lets through meet the physics too.
"""

from __future__ import annotations

import itertools
import math
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Final

import httpx
import numpy as np
import orjson

PROBLEM: Final = "application/problem+json"

HOSTILE: Final = (
    b"NaN", b"-Infinity", b"1e999", b"-1e308", b"1e-320", b"9" * 400, b"0", b"-1", b"null", b"true", b'""', b"[]", b"{}",
    b"\x00", b"\xff\xfe", b"\xef\xbb\xbf", b"\r\n", b";", b"\t", b'"', b"'", b"<", b">", b"&#0;", b"&lol;", b"]]>",
    b'<!DOCTYPE gpx [<!ENTITY lol "lol">]>', b'<!ENTITY a SYSTEM "file:///etc/passwd">', b"<?xml version='1.1'?>",
    b'<?xml version="1.0" encoding="utf-7"?>', b"[" * 3000, b"<a>" * 200, b"../../etc/passwd", b"2026-13-45T99:99:99Z",
    "\ud7ff\u202e".encode(), b"\xed\xa0\x80", b"1,5", b"time_s,time_s", b"length_m", b"{\"links\":", b"18446744073709551616",
)  # fmt: skip
"""What is put somewhere into a text."""

NUMBERS: Final = 13
"""So many of these, from the first on, stand where a number may stand."""


@dataclass
class Outcome:
    """What became of the mutants."""

    statuses: Counter[int] = field(default_factory=Counter)
    wrong: list[str] = field(default_factory=list)

    @property
    def mutants(self) -> int:
        """How many there were."""
        return sum(self.statuses.values())


def seeds() -> dict[str, list[tuple[str, bytes]]]:
    """Sound uploads by kind: path and body of each, with the media type of the kind."""
    times = [f"2026-05-01T08:{k // 60:02d}:{k % 60:02d}Z" for k in range(0, 600, 4)]
    points = "".join(
        f'<trkpt lat="{48 + k / 3e3:.5f}" lon="{11.5 + k / 5e3:.5f}"><ele>{500 + k % 7}</ele><time>{t}</time></trkpt>'
        for k, t in enumerate(times)
    )
    gpx = f'<?xml version="1.0"?><gpx version="1.1"><trk><trkseg>{points}</trkseg></trk></gpx>'
    bare = '<gpx><rte><rtept lat="48.1" lon="11.5"/><rtept lat="48.2" lon="11.6"><ele>520</ele></rtept></rte></gpx>'
    stamps = "".join(f"<when>{t}</when>" for t in times)
    coords = "".join(
        f"<gx:coord>{11.5 + k / 5e3:.5f} {48 + k / 3e3:.5f} 500</gx:coord>" for k in range(len(times))
    )
    kml = f'<kml xmlns:gx="g"><Placemark><gx:Track>{stamps}{coords}</gx:Track></Placemark></kml>'
    way = "<kml><LineString><coordinates>11.5,48.1,500 11.6,48.2</coordinates></LineString></kml>"
    speed = [10.0 * (1.0 - math.cos(k / 9.0)) for k in range(120)]
    samples = {
        "time_s": [float(k) for k in range(120)],
        "speed_m_s": speed,
        "elevation_m": [500.0 + k / 10.0 for k in range(120)],
    }
    rows = zip(*samples.values(), strict=True)
    csv = "time_s,speed_m_s,elevation_m\n" + "".join(f"{t:g},{v:.3f},{h:g}\n" for t, v, h in rows)
    links_csv = "length_m;speed_m_s;stop_s\n500;10,5;\n250;5;20\n"
    links = [
        {"length_m": 500.0, "speed_m_s": 12.0, "grade": 0.01},
        {"length_m": 250.0, "travel_time_s": 60.0, "stop_s": 20.0, "grade": -0.02},
    ]
    osrm = {"code": "Ok", "routes": [{"legs": [{"distance": 9000.0, "duration": 600.0, "steps": []}]}]}
    geojson = {
        "type": "Feature",
        "geometry": {
            "type": "LineString",
            "coordinates": [[11.5, 48.1, 510], [11.52, 48.1, 520], [11.6, 48.2]],
        },
        "properties": {"speed_m_s": 14.0},
    }
    trip = {"samples": samples, "soc": 0.8, "ambient_temperature_degc": -5.0, "reserve": 0.2}
    observed = {
        "time_s": [0.0, 1.0, 2.0, 40.0],
        "voltage_v": [360.0] * 4,
        "current_a": [3.0, 9.0, 40.0, 20.0],
    }
    return {
        "application/gpx+xml": [("/v1/routes", gpx.encode()), ("/v1/routes?speed_m_s=14", bare.encode())],
        "application/vnd.google-earth.kml+xml": [
            ("/v1/routes", kml.encode()),
            ("/v1/routes?speed_m_s=14", way.encode()),
        ],
        "text/csv": [("/v1/routes", csv.encode()), ("/v1/routes", links_csv.encode())],
        "application/json": [
            *(("/v1/routes", orjson.dumps(document)) for document in (links, osrm, geojson)),
            ("/v1/forecast", orjson.dumps(trip)),
            ("/v1/forecast", orjson.dumps({"links": links, "soc": 0.5})),
            ("/v1/forecast/update", orjson.dumps(trip | {"observed": observed})),
        ],
    }


def mutant(body: bytes, rng: np.random.Generator) -> bytes:
    """A body with one to three things wrong."""
    for _ in range(int(rng.integers(1, 4))):
        body = _damaged(body, rng)
    return body


def _damaged(body: bytes, rng: np.random.Generator) -> bytes:
    n = len(body)
    if n < 2:
        return HOSTILE[int(rng.integers(len(HOSTILE)))]
    a, b = sorted(int(x) for x in rng.integers(0, n, 2))
    match int(rng.integers(10)):
        case 0:  # a bit
            return body[:a] + bytes([body[a] ^ (1 << int(rng.integers(8)))]) + body[a + 1 :]
        case 1:  # cut off
            return body[:a]
        case 2:  # a piece is missing
            return body[:a] + body[min(b, a + 40) :]
        case 3:  # a piece twice
            return body[:b] + body[max(a, b - 200) : b] + body[b:]
        case 4:  # something strange in between
            return body[:a] + HOSTILE[int(rng.integers(len(HOSTILE)))] + body[a:]
        case 5 | 6 | 7 | 8:  # a number is another one
            places = [k for k in range(a, min(n, a + 400)) if body[k : k + 1].isdigit()]
            if not places:
                return body[:a]
            start = end = places[0]
            while end < n and (body[end : end + 1].isdigit() or body[end : end + 1] in b".eE"):
                end += 1
            return body[:start] + _number(rng) + body[end:]
        case _:  # two pieces change places
            return body[:a] + body[b:] + body[a:b]


def _number(rng: np.random.Generator) -> bytes:
    """No number, or one of any size."""
    if rng.random() < 0.3:
        return HOSTILE[int(rng.integers(NUMBERS))]
    return f"{10.0 ** rng.uniform(-9, 9):.{int(rng.integers(1, 17))}g}".encode()


def fuzz(url: str, mutants: int, seed: int = 0, *, kinds: tuple[str, ...] = ()) -> Outcome:
    """Send mutants to a service and look at what comes back.

    Parameters
    ----------
    url : str
    mutants : int
        Of each kind.
    seed : int
        Makes the same mutants.
    kinds : tuple of str
        Media types; all without.
    """
    found = Outcome()
    rng = np.random.default_rng(seed)
    with httpx.Client(base_url=url, timeout=60.0) as client:
        for kind, uploads in seeds().items():
            if kinds and kind not in kinds:
                continue
            for path, body in itertools.islice(_mutants(uploads, rng), mutants):
                answer = _sent(client, path, body, kind, found)
                if answer is not None and path.startswith("/v1/routes"):
                    again = {key: answer[key] for key in ("links", "elevation") if answer[key] is not None}
                    request = again or {"samples": answer["samples"]}
                    _sent(
                        client,
                        "/v1/forecast",
                        orjson.dumps(request),
                        "application/json",
                        found,
                        counted=False,
                    )
    return found


def _mutants(uploads: list[tuple[str, bytes]], rng: np.random.Generator) -> Iterator[tuple[str, bytes]]:
    for path, body in itertools.cycle(uploads):
        yield path, mutant(body, rng)


def _sent(
    client: httpx.Client, path: str, body: bytes, kind: str, found: Outcome, *, counted: bool = True
) -> dict[str, object] | None:
    """The document of an answer; what is neither an answer nor a problem document is noted."""
    answer = client.post(path, content=body, headers={"Content-Type": kind})
    status, given = answer.status_code, answer.headers.get("content-type", "")
    if counted:
        found.statuses[status] += 1
    if status == 200:
        return dict(orjson.loads(answer.content))
    if not (400 <= status < 500 and given == PROBLEM and orjson.loads(answer.content)["status"] == status):
        found.wrong.append(f"{path} {kind}: {status} {given} for {body[:2000]!r}")
    return None
