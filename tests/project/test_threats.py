"""Every threat of SECURITY.md has a test that exists."""

from __future__ import annotations

import re
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]


def rows() -> list[str]:
    threats = (ROOT / "SECURITY.md").read_text("utf-8").partition("## Threats")[2].partition("\n## ")[0]
    return [line for line in threats.splitlines() if line.startswith("| ")][1:]


def test_every_threat_names_tests_that_exist() -> None:
    assert len(rows()) >= 15
    for row in rows():
        named = re.findall(r"`(tests/[\w/]+\.py)::(test_\w+)`", row.rpartition(" | ")[2])
        assert named, row
        for file, name in named:
            assert re.search(rf"^def {name}\(", (ROOT / file).read_text("utf-8"), re.MULTILINE), (
                f"{file}::{name}"
            )


def test_every_actor_of_the_threats_is_named() -> None:
    actors = {row.split("|")[1].strip() for row in rows()} - {""}
    assert {
        "a page of another site, in the browser of the user",
        "somebody on the network",
        "a sender with the token of a car",
        "a file from the internet",
        "another process of the machine",
    } <= actors


def test_every_test_that_is_named_exists() -> None:
    """Also outside of the threats, where a whole file may be named; each guarantee for what is not trusted names one."""
    text = (ROOT / "SECURITY.md").read_text("utf-8")
    for file, name in re.findall(r"`(tests/[\w/]+\.py)(?:::(test_\w+))?`", text):
        code = (ROOT / file).read_text("utf-8")
        assert re.search(rf"^def {name or 'test_'}", code, re.MULTILINE), f"{file}::{name}"
    trusted = text.partition("## What is trusted")[2].partition("\nPacked")[0]
    guarantees = [row for row in trusted.splitlines() if "| no |" in row or "| no, " in row]
    assert len(guarantees) >= 1
    assert all("`tests/" in row for row in guarantees)
