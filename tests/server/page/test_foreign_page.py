"""A page of another site, in a real browser, that keeps requests to the service in flight."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any

import pytest
from tests.support.service_process import Service, serving, wait_for

FLIGHT = 32
PAGE = b"""<!doctype html><title>elsewhere</title><script>
window.ended = 0
const service = decodeURIComponent(location.hash.slice(1))
const advice = JSON.stringify({links: Array(2000).fill({length_m: 900, speed_m_s: 25}), soc: 0.8})
async function send(number) {
  const post = {method: "POST", mode: "no-cors", body: advice}
  const asks = [["/v1/need?distance_km=1999", {mode: "no-cors"}], ["/v1/advice", post], ["/v1/forecast/batch", post]]
  for (;;) {
    const [path, options] = asks[number++ % asks.length]
    await fetch(service + path, options).catch(() => null)
    window.ended += 1
  }
}
for (let number = 0; number < 32; number++) send(number)
</script>"""
DRIVE = {"links": [{"length_m": 2500, "speed_m_s": 14}], "soc": 0.8, "ambient_temperature_degc": -5.0}


class Elsewhere(BaseHTTPRequestHandler):
    """Answers every request with the page."""

    def do_GET(self) -> None:
        self.send_response(200)
        self.send_header("Content-Type", "text/html")
        self.end_headers()
        self.wfile.write(PAGE)

    def log_message(self, *_: Any) -> None:
        pass


@pytest.fixture
def alone(tmp_path: Any) -> Iterator[Service]:
    """A service on loopback as on the machine of a user, without a token."""
    with serving(tmp_path, "--workers", "2") as found:
        yield found


def own_s(service: Service, seconds: float) -> list[float]:
    """Times of the forecasts of the user meanwhile [s], in ascending order."""
    until, found = time.monotonic() + seconds, []
    while time.monotonic() < until:
        begun = time.perf_counter()
        assert service.forecast(DRIVE).status_code == 200
        found.append(time.perf_counter() - begun)
    return sorted(found)


def test_a_page_of_another_site_takes_no_computing_time(browser: Any, alone: Service) -> None:
    """Its refusals wait, so that a browser with its six connections cannot repeat them at once."""
    server = ThreadingHTTPServer(("127.0.0.1", 0), Elsewhere)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    context = browser.new_context()
    try:
        own_s(alone, 1.0)
        idle = own_s(alone, 3.0)
        page = context.new_page()
        page.goto(f"http://localhost:{server.server_port}/#{alone.url}")
        page.wait_for_function(f"window.ended > {3 * FLIGHT}")
        busy = own_s(alone, 4.0)
        ended = page.evaluate("window.ended")
    finally:
        context.close()
        server.shutdown()
        server.server_close()
    assert wait_for(lambda: len([r for r in alone.records() if r.get("status") == 403]) >= ended - FLIGHT)
    asked = [r for r in alone.records() if r.get("path") in ("/v1/need", "/v1/advice", "/v1/forecast/batch")]
    assert {r["path"] for r in asked} == {"/v1/need", "/v1/advice", "/v1/forecast/batch"}
    assert {r["status"] for r in asked} == {403}
    assert 'kind="distance"' not in alone.client.get("/metrics").text
    p99_idle, p99_busy = (times[int(0.99 * len(times))] for times in (idle, busy))
    shown = f"p99 {p99_idle:.4f} s idle, {p99_busy:.4f} s with {ended} foreign requests"
    assert p99_busy < max(3.0 * p99_idle, 0.1), shown
