"""What keeps the project and is no part of the package: makers of shipped data, writers of the docs, measures of the code.

Run them from the folder of the project, with `tests` and `benchmarks` beside: ``python -m tools.docs.make_results``.
"""

import os
from pathlib import Path
from typing import Final

ROOT: Final = Path(__file__).resolve().parents[1]
"""The folder of the project."""

DOCS: Final = ROOT / "docs"
DATA: Final = Path(os.environ.get("TRIPWATT_DATA", ROOT / "../shared/data"))
REFERENCE: Final = Path(os.environ.get("TRIPWATT_REFERENCE", ROOT / "../shared/reference"))
CATALOGUE: Final = Path(os.environ.get("TRIPWATT_CATALOGUE", REFERENCE / "ev_catalogue"))
"""Where data are: by environment variables, or beside the project."""
