"""Stamps after commands and pages have moved: ``python -m tools.docs.moved OLD``, with OLD a checkout from before.

A stamp names commands and places. Where those alone have new names (`RENAMED`) and the generated files hold the same, the stamp is
written anew under them, and nothing is run. A model is the same where its forecasts are.
"""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

from tools import ROOT
from tools.command import run
from tools.docs import make_results, pages
from tools.quality import probe
from tripwatt.forecasting import load_model

RENAMED: Final = (
    (r"^docs/fit_default_model\.py", "-m tools.data.fit_default_model"),
    (r"^docs/(\w+)\.py", r"-m tools.docs.\1"),
    (r" --write docs/\w+\.md$", " --write"),
    (r"transfer_covariates \{data\}$", "transfer_covariates"),
    (r"#(\w+)(?: begin|:begin)$", r"#\1"),
    (r"#(\w+) (\w+)(?: begin)?$", r"#\1-\2"),
    (r"^docs/(vehicles|library|synthetic|routes)\.md", r"docs/reference/\1.md"),
    (r"^docs/(argonne|stages|ved|uncertainty|peers)\.md", r"docs/explanation/\1.md"),
)
"""Old name -> new name, of commands and of places, one after the other."""


def renamed(name: str) -> str:
    """A command or a place as it is called now."""
    for old, new in RENAMED:
        name = re.sub(old, new, name)
    return name


def forecasts(folder: Path) -> str:
    """Digest of what a stored model forecasts."""
    model = load_model(folder)
    rows = [probe.of_forecast(model.forecast(plan)) for plan in probe.plans()]
    return probe.digest(probe.rounded({folder.name: rows}))


def content(root: Path, place: str) -> str:
    """What a place of a checkout holds; links without their folders, since those change with the folder of the page."""
    name, _, part = place.partition("#")
    if name == make_results.MODEL:
        return forecasts(root / name)
    if not name.endswith(".md"):
        return make_results.digest(root / name)
    text = (root / name).read_text("utf-8")
    if part and f"<!-- {part}:begin -->" in text:
        text = pages.part(text, part)
    elif part:
        (text,) = re.findall(rf"<!-- {re.escape(part)}.*?-->(.*?)<!-- ", text, re.S)
    return make_results.digest_of_page(text)


def restamped(result: make_results.Result, stamp: Mapping[str, Any], old: Path) -> dict[str, Any]:
    """A stamp under the names of now. Raises ValueError where a command or what it wrote is another one."""
    if tuple(map(renamed, stamp["settings"])) != result.commands:
        raise ValueError(f"{result.name}: {stamp['settings']} is not {list(result.commands)}")
    for place in stamp["files"]:
        if content(old, place) != content(ROOT, renamed(place)):
            raise ValueError(f"{result.name}: {place} differs from {renamed(place)}")
    files = {renamed(place): make_results.written(renamed(place)) for place in stamp["files"]}
    data = dict(stamp["data"])
    for name in data:
        if (ROOT / name).exists() and content(old, name) == content(ROOT, name):
            data[name] = make_results.digest(ROOT / name)
    return {**stamp, "settings": list(result.commands), "data": data, "files": files}


def main(old: Path) -> None:
    """Write the stamps of a checkout from before under the names of now."""
    stamps = make_results.read(old / "docs" / "results" / "stamps.json")
    results = {result.name: result for result in make_results.RESULTS}
    new = {name: restamped(results[name], stamp, old) for name, stamp in stamps.items()}
    make_results.STAMPS.write_text(json.dumps(new, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    run(main)
