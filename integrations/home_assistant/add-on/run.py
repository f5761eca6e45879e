"""Starts the service in the add-on: each option of the add-on is a variable of the environment of `tripwatt serve`."""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

DATA = Path(os.environ.get("ADD_ON_DATA", "/data"))
"""Where the Supervisor puts the options, and what lasts longer than the container."""


def variables(options: Mapping[str, Any]) -> dict[str, str]:
    """The variables of the environment for options; those that are empty are left out."""
    texts = {
        name: " ".join(map(str, value)) if isinstance(value, list) else f"{value}"
        for name, value in options.items()
        if value is not None
    }
    return {f"TRIPWATT_{name.upper()}": text for name, text in texts.items() if text}


def main() -> None:
    """Become the service."""
    chosen = variables(json.loads((DATA / "options.json").read_text("utf-8")))
    if "TRIPWATT_TOKEN" not in chosen:
        sys.exit("tripwatt: set a token of 16 characters or more in the configuration of the add-on")
    (DATA / "cars").mkdir(exist_ok=True)
    chosen["TRIPWATT_CARS"] = str(DATA / "cars")
    os.execvpe("tripwatt", ["tripwatt", "serve", *sys.argv[1:]], os.environ | chosen)


if __name__ == "__main__":
    main()
