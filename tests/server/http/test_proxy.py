"""The service behind nginx, with the configuration of `docs/reference/service.md`."""

from __future__ import annotations

import re
import shutil
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final

import httpx
import pytest
from tests.support import ROOT
from tests.support.service_process import Service, free_port, serving, wait_for

NGINX: Final = shutil.which("nginx") or shutil.which("/usr/sbin/nginx")
NAME: Final = "tripwatt.example.org"
needs_nginx = pytest.mark.skipif(NGINX is None, reason="no nginx: install nginx-light from the distribution")


def shown() -> list[str]:
    """The configuration of the page, and its location under a path."""
    page = (ROOT / "docs" / "reference" / "service.md").read_text("utf-8")
    return re.findall(r"```nginx\n(.*?)```", page, re.DOTALL)


def under_a_path(server: str, location: str) -> str:
    return re.sub(r" *location / \{.*?\}\n", location, server, flags=re.DOTALL)


def written(folder: Path, server: str) -> Path:
    """A whole configuration in a folder, with the files that nginx writes."""
    file = folder / "nginx.conf"
    paths = "".join(
        f"{kind}_temp_path {folder}/{kind};\n"
        for kind in ("client_body", "proxy", "fastcgi", "uwsgi", "scgi")
    )
    file.write_text(
        f"daemon off;\npid {folder}/pid;\nerror_log {folder}/error.log;\n"
        f"events {{}}\nhttp {{\naccess_log off;\n{paths}{server}}}\n"
    )
    return file


def call(file: Path, *more: str) -> list[str]:
    assert NGINX is not None
    return [NGINX, "-c", f"{file}", "-p", f"{file.parent}", "-e", f"{file.parent / 'error.log'}", *more]


@contextmanager
def proxied(folder: Path, server: str, service: Service) -> Iterator[str]:
    """nginx in front of a service, without TLS; its address as a browser names it."""
    port = free_port()
    server = re.sub(r" *ssl_\w+ .*\n", "", server).replace("443 ssl", f"127.0.0.1:{port}")
    process = subprocess.Popen(call(written(folder, server.replace("127.0.0.1:8000", service.url[7:]))))
    try:

        def answers() -> bool:
            try:
                return httpx.get(f"http://127.0.0.1:{port}/").status_code > 0
            except httpx.TransportError:
                return False

        assert wait_for(answers, 20.0)
        yield f"http://127.0.0.1:{port}"
    finally:
        process.terminate()
        process.wait(20)


@needs_nginx
@pytest.mark.parametrize("path", ["/", "/tripwatt/"])
def test_nginx_takes_the_configuration(tmp_path: Path, path: str) -> None:
    server, location = shown()
    command = [
        "openssl",
        "req",
        "-x509",
        "-newkey",
        "rsa:2048",
        "-nodes",
        "-days",
        "1",
        "-subj",
        f"/CN={NAME}",
    ]
    if shutil.which("openssl") is None:
        pytest.skip("no openssl: no certificate can be made")
    keys = ["-keyout", f"{tmp_path / 'tripwatt.key'}", "-out", f"{tmp_path / 'tripwatt.pem'}"]
    subprocess.run([*command, *keys], check=True, capture_output=True)
    server = server.replace("/etc/ssl/", f"{tmp_path}/")
    file = written(tmp_path, server if path == "/" else under_a_path(server, location))
    done = subprocess.run(call(file, "-t"), capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


@needs_nginx
def test_the_page_behind_a_proxy_without_tls_is_that_of_the_service(
    service: Service, drive: dict[str, Any], tmp_path: Path
) -> None:
    """Browsers send `Origin` with the name of the proxy, and no `Sec-Fetch-Site`."""
    with proxied(tmp_path, shown()[0], service) as url:
        host = f"{NAME}:{url.rpartition(':')[2]}"

        def posted(origin: str, **more: str) -> httpx.Response:
            headers = {"Host": host, "Origin": origin, **more}
            return httpx.post(f"{url}/v1/forecast", json=drive, headers=headers, timeout=60.0)

        assert posted(f"http://{host}").status_code == 200
        refused = posted("http://evil.example", **{"X-Forwarded-Host": "evil.example"})
        assert (refused.status_code, refused.json()["type"]) == (403, "/problems/foreign-site")
        assert "--cors-origin" in refused.json()["detail"]
        assert "http://evil.example" in refused.json()["detail"]


@needs_nginx
def test_the_service_is_below_a_path(tmp_path: Path) -> None:
    (tmp_path / "logs").mkdir()
    server, location = shown()
    with (
        serving(tmp_path / "logs", "--workers", "1", "--prefix", "/tripwatt") as service,
        proxied(tmp_path, under_a_path(server, location), service) as url,
    ):
        assert httpx.get(f"{url}/tripwatt/healthz").json()["status"] == "alive"
        assert httpx.get(f"{url}/tripwatt/openapi.json").json()["servers"] == [{"url": "/tripwatt"}]
        assert httpx.get(f"{url}/healthz").status_code >= 400
