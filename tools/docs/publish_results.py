"""Publish an evaluation: ``python -m tools.docs.publish_results [OUT]``, a step of ``make results``.

Renews docs/explanation/paper.md from the protocol `paper`. Copies OUT/results.json (scores and findings, no trip data) to docs/results/, as `paper.json` or `forecast.json` by its
protocol, and renews the tables of docs/explanation/results.md from it. OUT
is `out` by default; a JSON file, such as the published one itself, or what `python -m benchmarks.planned --json FILE`
writes, serves as well.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

from PIL import Image

from tools import DOCS
from tools.docs.paper_page import FIGURES
from tools.docs.results_pages import update_coverage, update_paper_page, update_results_page

RESULTS = DOCS / "results"


def publish(
    out: Path,
    results_folder: Path = RESULTS,
    page: Path = DOCS / "explanation" / "results.md",
) -> Path:
    """Copy and renew; gives the copy.

    Parameters
    ----------
    out : Path
        Folder of `tripwatt evaluate`, or a `results.json`.
    results_folder, page : Path
        Where the copy and the wide tables go. What the intervals held is written into `uncertainty.md` beside
        the latter. The page on the paper, `paper.md`, stands beside the latter, and its figures are copied from OUT/figures
        to the folder `images` beside both.
    """
    source = out / "results.json" if out.is_dir() else out
    results = json.loads(source.read_text(encoding="utf-8"))
    update_results_page(results, page)
    if results["protocol"] == "forecast":
        update_coverage(results, page.with_name("uncertainty.md"))
    if results["protocol"] == "paper":
        transfer, claims = (
            json.loads((RESULTS / f"{name}.json").read_text("utf-8")) for name in ("transfer", "paper_claims")
        )
        update_paper_page(results, page.with_name("paper.md"), transfer, claims)
        for name in FIGURES:
            drawn = out / "figures" / f"{name}.png"
            if drawn.is_file():
                with Image.open(drawn) as image:  # 64 colours are enough, and a third of the size
                    image.convert("RGB").quantize(64).save(
                        page.parents[1] / "images" / f"paper-{name}.png", optimize=True
                    )
    copy = results_folder / f"{results['protocol']}.json"
    copy.parent.mkdir(parents=True, exist_ok=True)
    copy.write_text(json.dumps(results, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
    return copy


if __name__ == "__main__":
    print(publish(Path(sys.argv[1] if len(sys.argv) > 1 else "out")))
