"""The report of a transfer: one self-contained page, its figures, and the files beside it."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING

from tripwatt.report.html import write_page, write_whole
from tripwatt.report.transfer_panels import transfer_panels

if TYPE_CHECKING:
    from tripwatt.evaluation.transfer import TransferRun


def write_transfer(run: TransferRun, out: Path) -> None:
    """Write `results.json`, `trips.csv`, `report.html` and `figures/` into a folder, `results.json` last.

    Parameters
    ----------
    run : TransferRun
    out : Path
        Made when it is not there.
    """
    panels, results = transfer_panels(run), run.results
    source, target = results["from"], results["to"]
    facts = [
        ("From", f"{source['vehicle_title']}, {source['trips_used']} trips ({source['dataset']})"),
        ("To", f"{target['vehicle_title']}, {target['trips_used']} trips ({target['dataset']})"),
        ("Draws, seed", f"{results['draws']}, {results['seed']}"),
        ("Hidden", ", ".join(results["hidden"]).replace("_", " ") or "nothing"),
    ]
    write_page(
        out,
        "transfer.html.jinja",
        panels,
        facts=facts,
        notes=results["notes"],
        audit=results["audit"],
        citations=results["citations"],
        versions=", ".join(f"{name} {version}" for name, version in results["versions"].items()),
    )
    run.trips.to_csv(out / "trips.csv", index=False, lineterminator="\n")
    write_whole(out / "results.json", json.dumps(results, indent=1, allow_nan=False).encode("utf-8"))
