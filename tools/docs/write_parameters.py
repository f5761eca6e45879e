"""Renew the table of a car's values in docs/explanation/car-model.md and that of licences in docs/reference/vehicles.md.

Run ``python -m tools.docs.write_parameters`` after a change of a car or of the licences.
"""

import inspect
import re
from collections.abc import Mapping

from tools.docs import pages
from tripwatt.vehicles import LICENCES, Vehicle, load_vehicle
from tripwatt.vehicles.vehicle import SECTIONS
from tripwatt.vehicles.writing import format_value


def render_parameters(vehicle: Vehicle) -> str:
    """Markdown tables of all values of a car, one for each part that it has, with their units."""
    blocks = []
    for section, part in SECTIONS.items():
        rows = [
            f"| `{key}` | {format_value(entry)} | {entry.unit} | {meaning} |"
            for key, meaning in meanings(part).items()
            if (entry := vehicle.entries.get(f"{section}.{key}")) is not None
        ]
        if rows:
            head = ["| key | value | unit | meaning |", "|---|---|---|---|"]
            blocks.append("\n".join([f"#### {section}", "", *head, *rows]))
    return "\n\n".join(blocks) + "\n"


def meanings(part: type) -> Mapping[str, str]:
    """Meaning of each field of a part, from the docstring of its class; the table has the unit in a column of its own."""
    text = (inspect.getdoc(part) or "").partition("Attributes\n")[2]
    rows = re.findall(r"^(\w+) : .*\n((?:    .*\n?)+)", text, re.MULTILINE)
    return {name: re.sub(r" \[[^\]]*\]", "", " ".join(words.split())).rstrip(".") for name, words in rows}


def render_licences() -> str:
    """Markdown table of the licences and what each means."""
    rows = [f"| `{name}` | {meaning} |" for name, meaning in LICENCES.items()]
    return "\n".join(["| licence | meaning |", "|---|---|", *rows]) + "\n"


def main() -> None:
    """Renew both tables."""
    pages.renew("explanation/car-model.md", "parameters", render_parameters(load_vehicle("bmw_i3_60ah")))
    pages.renew("reference/vehicles.md", "licences", render_licences())


if __name__ == "__main__":
    main()
