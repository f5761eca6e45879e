"""The page in a real browser: how fast the picture follows a slider, its size, and what axe says.

`python -m tools.quality.page` prints the figures as JSON. It needs chromium. `--map MAP --from A --to B` measures the map instead, with
a value of `tripwatt serve --map` and the names of two places.
"""

from __future__ import annotations

import json
import re
import shutil
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any, Final

import numpy as np
from tests.support.service_process import serving
from typer import Option

import tripwatt.server.http
from tools.command import run

CHROMIUM: Final = ("chromium-headless-shell", "chromium", "chromium-browser", "google-chrome")
"""Programs that will do, the quickest first: the shell without windows opens a page in half the time."""

SIZES: Final = {"desktop": (1440, 900), "phone": (390, 844)}
SCHEMES: Final = ("light", "dark")
MODES: Final = ("Plan", "Compare", "Drive")
SHOWN: Final = ".result .plot canvas"
MAP_SHOWN: Final = ".map-canvas[data-ready]"
ADVICE_MOVES: Final = 10
MOVES: Final = 60
DRAGS: Final = 20
DRAGGED: Final = 0.7
"""How far B is dragged towards A, as a share of their distance."""

PAINTS: Final = 5
REST_MS: Final = 60

FOLLOW: Final = """
([label, by]) => new Promise((resolve, reject) => {
  const slider = [...document.querySelectorAll("input[type=range]")]
    .find((input) => input.labels[0].textContent === label);
  const canvas = document.querySelector(".result .plot canvas");
  const brush = canvas.getContext("2d");
  const pixels = () => {
    let sum = 7;
    const data = new Uint32Array(brush.getImageData(0, 0, canvas.width, canvas.height).data.buffer);
    for (let k = 0; k < data.length; k += 3) sum = (Math.imul(sum, 31) + data[k]) | 0;
    return sum;
  };
  const before = pixels();
  const start = performance.now();
  slider.valueAsNumber += by;
  slider.dispatchEvent(new Event("input", { bubbles: true }));
  const look = () => {
    if (pixels() !== before) resolve(performance.now() - start);
    else if (performance.now() - start > 5000) reject(new Error("the picture does not follow"));
    else requestAnimationFrame(look);
  };
  requestAnimationFrame(look);
})
"""
"""Moves a slider and tells after how many milliseconds the pixels of the battery chart are others."""


def chromium() -> str | None:
    """Path of the browser; None if there is none."""
    return next(filter(None, map(shutil.which, CHROMIUM)), None)


@contextmanager
def browsing() -> Iterator[Any]:
    """A browser. While it lives, this thread has a running event loop."""
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        # without a user of its own, chromium's sandbox refuses to start
        browser = playwright.chromium.launch(executable_path=chromium(), args=["--no-sandbox"])
        yield browser
        browser.close()


FOLLOW_DRAG: Final = """
() => {
  window.follow = { start: 0, end: 0 };
  new MutationObserver(() => { window.follow.end ||= performance.now(); })
    .observe(document.querySelector(".stats"), { subtree: true, characterData: true, childList: true });
  document.addEventListener("mousemove", () => {
    window.follow.start = performance.now();
    window.follow.end = 0;
  }, true);
}
"""
"""Tells when the pointer moved last, and when energy, consumption, distance or time changed first after it."""


def context_of(browser: Any, size: str, scheme: str, locale: str = "en-IE") -> Any:
    """A browser with nothing remembered; English with kilometres unless another locale is given."""
    width, height = SIZES[size]
    phone = size == "phone"
    return browser.new_context(
        viewport={"width": width, "height": height},
        color_scheme=scheme,
        locale=locale,
        is_mobile=phone,
        has_touch=phone,
        reduced_motion="reduce",
    )


def follow_times(page: Any, moves: int) -> list[float]:
    """How long the picture takes to follow, a value a move [ms]."""
    times = []
    for k in range(moves):
        times.append(float(page.evaluate(FOLLOW, ["Outside", -2 if k % 2 else 2])))
        page.wait_for_timeout(REST_MS)
    return times


def advice_times(page: Any, moves: int) -> list[float]:
    """How long the advice with its speeds takes to follow a slider, a value a move [ms]."""
    times = []
    for k in range(moves):
        started = time.perf_counter()
        page.evaluate(FOLLOW, ["Outside", -2 if k % 2 else 2])
        page.wait_for_selector(".advice[aria-busy=false]")
        times.append(1000.0 * (time.perf_counter() - started))
        page.wait_for_timeout(1000)  # a slider at rest: the page spaces what it asks
    return times


def quantiles_ms(times: list[float]) -> dict[str, float]:
    """Median, 95th percentile and maximum of times."""
    return {f"p{q}_ms": round(float(np.percentile(times, q)), 1) for q in (50, 95, 100)}


def violations(page: Any) -> list[tuple[str, str]]:
    """What axe-core finds on the page as it is: impact and rule."""
    from axe_playwright_python.sync_playwright import Axe

    return [(v["impact"], v["id"]) for v in Axe().run(page).response["violations"]]


def measure() -> dict[str, Any]:
    """Measure all figures of the page."""
    folder = Path(tripwatt.server.http.__file__).with_name("page")
    files = {f.relative_to(folder).as_posix(): f.stat().st_size for f in folder.rglob("*") if f.is_file()}
    figures: dict[str, Any] = {"bundle_bytes": files, "bundle_total_bytes": sum(files.values())}
    with tempfile.TemporaryDirectory() as logs, serving(Path(logs)) as service, browsing() as browser:
        for size in SIZES:
            for scheme in SCHEMES:
                page = context_of(browser, size, scheme).new_page()
                page.goto(service.url)
                page.wait_for_selector(SHOWN)
                for mode in MODES:
                    page.get_by_role("radio", name=mode).check()
                    page.wait_for_timeout(300)
                    at = f"{size} {scheme} {mode.lower()}"
                    figures.setdefault("axe", {})[at] = violations(page)
                    if mode != "Drive" and scheme == "light":
                        figures.setdefault("slider", {})[at] = quantiles_ms(follow_times(page, MOVES))
                    if mode == "Plan" and scheme == "light":
                        figures.setdefault("advice", {})[size] = quantiles_ms(
                            advice_times(page, ADVICE_MOVES)
                        )
                page.context.close()
    return figures


def choose_place(page: Any, label: str, name: str) -> None:
    """Type a name and take the first suggestion with the keyboard."""
    page.get_by_label(label, exact=True).first.focus()
    page.keyboard.type(name)
    page.locator("[role=option]").first.wait_for()
    page.keyboard.press("Enter")


def choose_car(page: Any, typed: str, name: str | re.Pattern[str]) -> None:
    """Search in the field for the car, and take what has a name with the keyboard alone."""
    field = page.locator("header [role=combobox]")
    field.focus()
    field.fill(typed)
    option = page.get_by_role("option", name=name).first
    option.wait_for()
    while option.get_attribute("aria-selected") != "true":
        page.keyboard.press("ArrowDown")
    page.keyboard.press("Enter")


def measure_map(named: str, start: str, end: str) -> dict[str, Any]:
    """Time from the start of the page to the first picture of the map, and from a move of B to its new arrival [ms]."""
    with (
        tempfile.TemporaryDirectory() as logs,
        serving(Path(logs), "--map", named) as service,
        browsing() as browser,
    ):
        paints = []
        for _ in range(PAINTS):
            page = context_of(browser, "desktop", "light").new_page()
            page.goto(service.url)
            page.wait_for_selector(MAP_SHOWN)
            paints.append(page.evaluate("performance.now()"))
            if len(paints) < PAINTS:
                page.context.close()
        choose_place(page, "From", start)
        choose_place(page, "To", end)
        page.get_by_role("button", name="Plan", exact=True).click()
        page.locator(".journey-answer:not(.old)").wait_for()
        page.wait_for_timeout(1000)
        page.evaluate(FOLLOW_DRAG)
        marks = [page.locator(f".end-{end}").bounding_box() for end in ("to", "from")]
        (x, y), (ax, ay) = ((box["x"] + box["width"] / 2, box["y"] + box["height"] / 2) for box in marks)
        page.mouse.move(x, y)
        page.mouse.down()
        times = []
        for k in range(1, DRAGS + 1):
            share = DRAGGED * k / DRAGS
            page.mouse.move(x + share * (ax - x), y + share * (ay - y))
            page.wait_for_function("() => window.follow.end > 0")
            times.append(page.evaluate("window.follow.end - window.follow.start"))
            page.wait_for_timeout(REST_MS)
        page.mouse.up()
    return {
        "map_first_paint_ms": [round(float(t)) for t in sorted(paints)],
        "drag_ms": {f"p{q}": round(float(np.percentile(times, q))) for q in (0, 50, 95, 100)},
    }


def main(
    map_value: Annotated[str, Option("--map")] = "",
    start: Annotated[str, Option("--from")] = "Vaduz",
    end: Annotated[str, Option("--to")] = "Ruggell",
) -> None:
    """Print the figures of the page, or of the map."""
    print(json.dumps(measure_map(map_value, start, end) if map_value else measure(), indent=2))


if __name__ == "__main__":
    run(main)
