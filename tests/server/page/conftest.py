"""A real browser with the page of a real service: one of each for a module."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from tests.support.service_process import TOKEN, Service, serving
from tools.quality.page import SHOWN, browsing, chromium, context_of


@pytest.fixture(scope="module")
def cars(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of the cars of the service."""
    return tmp_path_factory.mktemp("cars")


@pytest.fixture(scope="module")
def service(cars: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Service]:
    more = ("--workers", "1", "--cars", f"{cars}", "--limit", "live_every_s=0.1")
    with serving(tmp_path_factory.mktemp("page"), *more, token=TOKEN) as found:
        found.client.headers["Authorization"] = f"Bearer {TOKEN}"
        yield found


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    """For one module: while it lives, this thread has a running event loop, and asyncio cannot begin another."""
    if chromium() is None:
        pytest.skip("no chromium: install Debian's package of that name (as root, `make browser` does)")
    pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    with browsing() as found:
        yield found


@pytest.fixture
def look(browser: Any, service: Service) -> Iterator[Callable[..., Any]]:
    """Opens the page. At the end, the console has only what was expected, and all requests went to the service."""
    contexts, messages, strangers, allowed = [], [], [], []

    def open_page(
        size: str = "desktop",
        scheme: str = "light",
        expect: str = "",
        stranger: bool = False,
        locale: str = "en-IE",
    ) -> Any:
        context = context_of(browser, size, scheme, locale)
        contexts.append(context)
        context.set_default_timeout(60_000)
        if not stranger:
            context.add_init_script(f"sessionStorage.setItem('tripwatt.token', '{TOKEN}')")
        page = context.new_page()
        allowed.extend(part for part in expect.split("|") if part)
        page.on("console", lambda message: messages.append(f"{message.type}: {message.text}"))
        page.on("pageerror", lambda error: messages.append(f"error: {error}"))
        page.on(
            "request",
            lambda request: (
                strangers.append(request.url) if not request.url.startswith(service.url) else None
            ),
        )
        page.goto(service.url)
        page.wait_for_selector("dialog[open]" if stranger else SHOWN)
        return page

    yield open_page
    for context in contexts:
        context.close()
    assert [text for text in messages if not any(part in text for part in allowed)] == []
    assert strangers == []


def serious(page: Any) -> list[tuple[str, list[str]]]:
    """What axe finds on a page that is serious or critical: the rule, and where."""
    axe = pytest.importorskip("axe_playwright_python.sync_playwright", reason="axe is not installed").Axe()
    return [
        (found["id"], [node["html"][:120] for node in found["nodes"]])
        for found in axe.run(page).response["violations"]
        if found["impact"] in ("serious", "critical")
    ]
