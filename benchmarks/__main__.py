"""`python -m benchmarks --out bench.json`: every measurement, all ratios in one run."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path

from tools.command import run

from benchmarks import batch, forecast, gam, peers, pipeline

SUITES = (pipeline.run, batch.rows, forecast.run, gam.run, peers.rows)


def main(out: Path = Path("bench.json")) -> None:
    """Every measurement, all ratios in one run."""
    rows = []
    for suite in SUITES:
        for row in suite():
            rows.append(asdict(row))
            print(row.line, flush=True)
    out.write_text(json.dumps(rows, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    run(main)
