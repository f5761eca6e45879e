"""A router's server on loopback that answers as it is told, and a map folder with places and without roads."""

from __future__ import annotations

import json
import socket
import subprocess
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

from tests.support.service_process import free_port

from tripwatt.roads.maps.engine import configuration, require_valhalla
from tripwatt.roads.maps.extract import Named
from tripwatt.roads.maps.folder import ATTRIBUTION, FORMAT, INDEX_NAME, INFO_NAME, MapFolder
from tripwatt.roads.maps.index import write_index
from tripwatt.roads.maps.stations import Station

SETTLEMENTS = [Named("town", "Westend", 47.0, 9.0), Named("village", "Ostheim", 47.0, 9.1)]
OBJECTS = [
    *SETTLEMENTS,
    Named("street", "Hauptstraße", 47.001, 9.001),
    Named("house", "12a", 47.001, 9.002, "Hauptstraße"),
    Named("poi", "Westend Arena", 47.002, 9.0),
    Station(47.0, 9.05, "Halbweg", 150_000.0, direct_current=True),
]


def write_map(folder: Path) -> Path:
    """A map folder with the places of a straight road and one charging station, for the roads of a server."""
    folder.mkdir()
    indexed = write_index(folder / INDEX_NAME, SETTLEMENTS, OBJECTS)
    bounds = [46.9, 8.9, 47.1, 9.2]
    about = {
        "format": FORMAT,
        "extract": "made",
        "attribution": ATTRIBUTION,
        "bounds_deg": bounds,
        "terrain": {"known": False, "source": "", "tiles": 0, "missing": []},
    }
    (folder / INFO_NAME).write_text(json.dumps(indexed | about), "utf-8")
    return folder


class RouterServer:
    """What the running server answers with."""

    def __init__(self, url: str) -> None:
        self.url = url
        self.document: Any = {}
        self.status = 200
        self.delay_s = 0.0
        self.paths: list[str] = []


@contextmanager
def answering(document: Any) -> Iterator[RouterServer]:
    """A server on a free port that answers every request with a document."""
    found = RouterServer("")

    class Handler(BaseHTTPRequestHandler):
        protocol_version = "HTTP/1.1"

        def do_GET(self) -> None:
            self.rfile.read(int(self.headers.get("content-length", 0)))
            found.paths.append(self.path)
            time.sleep(found.delay_s)
            made = found.document(self.path) if callable(found.document) else found.document
            body = made if isinstance(made, bytes) else json.dumps(made).encode()
            self.send_response(found.status)
            self.send_header("Content-Type", "application/json")
            self.send_header("Content-Length", str(len(body)))
            self.end_headers()
            self.wfile.write(body)

        do_POST = do_GET  # noqa: N815

        def log_message(self, *_: Any) -> None:
            pass

    server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
    server.daemon_threads = True
    thread = threading.Thread(target=server.serve_forever, args=(0.05,), daemon=True)
    thread.start()
    found.url, found.document = f"http://127.0.0.1:{server.server_port}", document
    try:
        yield found
    finally:
        server.shutdown()
        server.server_close()
        thread.join(10.0)


def served_configuration(folder: Path, port: int) -> dict[str, Any]:
    """Valhalla's configuration of a map folder as a server on loopback."""
    config, here = configuration(folder), folder.resolve()
    service = config["httpd"]["service"]
    service |= {"listen": f"tcp://127.0.0.1:{port}", "drain_seconds": 0}
    service |= {name: f"ipc://{here}/{name}.socket" for name in ("loopback", "interrupt")}
    for part in ("loki", "thor", "odin", "meili"):
        config[part]["service"]["proxy"] = f"ipc://{here}/{part}.socket"
    return config


@contextmanager
def valhalla_serving(built: MapFolder) -> Iterator[str]:
    """A real Valhalla on loopback that serves the roads of a map: its address, as `open_atlas` takes it."""
    port = free_port()
    config = built.folder / "server.json"
    config.write_text(json.dumps(served_configuration(built.folder, port)), "utf-8")
    program = require_valhalla() / "bin" / "valhalla_service"
    process = subprocess.Popen([program, config, "1"], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        until = time.monotonic() + 30.0
        while time.monotonic() < until:
            with socket.socket() as probe:
                if probe.connect_ex(("127.0.0.1", port)) == 0:
                    break
            time.sleep(0.1)
        yield f"{built.folder}@http://127.0.0.1:{port}"
    finally:
        process.terminate()
        process.wait(20)
