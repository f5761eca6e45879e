"""Whether a running service is what its OpenAPI document says: schemathesis, all checks.

That a request which fits the schema is answered is checked but for 422: lists of one length and times that increase
cannot be said in a schema.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

from tests.support import ROOT

PLAIN = "^/(?!v1/(journeys|reachable|places|tiles|map/view|live|events|need|telemetry|cars))"
"""Paths of a service without a map and without cars on the road; the others answer 501."""

CONFIGURATION = """
[checks.positive_data_acceptance]
expected-statuses = ["2xx", "404", "422"]
"""


@dataclass(frozen=True)
class Conformance:
    """What schemathesis said."""

    code: int
    cases: int
    failures: int
    text: str

    @property
    def clean(self) -> bool:
        """Whether it tried and found nothing."""
        return self.code == 0 and self.cases > 0


def conformance(
    url: str, examples: int, seed: int = 1, *, only: str = "", phases: str = "", timeout_s: float = 1800.0
) -> Conformance:
    """Run schemathesis against a service.

    Parameters
    ----------
    url : str
        Of the service.
    examples : int
        Most test cases an operation while fuzzing; examples and coverage of the schema come before.
    seed : int
    only : str
        Regular expression of the paths to try; all when empty.
    phases : str
        Phases of schemathesis, with commas; all when empty.
    timeout_s : float
    """
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "schemathesis.toml").write_text(CONFIGURATION, encoding="utf-8")
        command = [
            *(sys.executable, "-m", "schemathesis.cli", "run", f"{url}/openapi.json", "--no-color"),
            *(("--include-path-regex", only) if only else ()),
            *(("--phases", phases) if phases else ()),
            *("-n", str(examples), "--seed", str(seed), "-c", "all", "--continue-on-failure"),
        ]  # fmt: skip
        environment = os.environ | {
            "SCHEMATHESIS_HOOKS": "tests.support.service_hooks",
            "PYTHONPATH": str(ROOT),
        }
        done = subprocess.run(
            command,
            cwd=folder,
            env=environment,
            capture_output=True,
            text=True,
            timeout=timeout_s,
            check=False,
        )
    text = done.stdout + done.stderr
    cases = re.search(r"(\d+) generated", text)
    failures = re.search(r"found (\d+) unique failure", text) or re.search(r"(\d+) failures?", text)
    return Conformance(
        done.returncode, int(cases[1]) if cases else 0, int(failures[1]) if failures else 0, text
    )
