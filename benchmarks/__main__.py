"""`python -m benchmarks --out bench.json`: every measurement, all ratios in one run."""

from __future__ import annotations

import argparse
import json
from pathlib import Path

from benchmarks import forecast, gam, peers, pipeline

SUITES = (pipeline.run, forecast.run, gam.run, peers.rows)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("bench.json"))
    out = parser.parse_args().out
    rows = []
    for suite in SUITES:
        for row in suite():
            rows.append(row.as_dict())
            peer = (
                "" if row.peer is None else f"   {row.peer}: {row.peer_value:,.4g}   ratio {row.ratio:,.3g}"
            )
            print(f"{row.name}: {row.value:,.4g} {row.unit}{peer}", flush=True)
    out.write_text(json.dumps(rows, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
