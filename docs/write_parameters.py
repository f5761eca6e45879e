"""Renew the table of a car's values in docs/model.md and that of licences in docs/vehicles.md.

Run ``python docs/write_parameters.py`` after a change of a car or of the licences.
"""

from pathlib import Path

from tripwatt.vehicles import load_vehicle, render_licences, render_parameters

PAGE = Path(__file__).with_name("model.md")
LIBRARY = Path(__file__).with_name("vehicles.md")


def renewed(page: str, table: str, name: str) -> str:
    """The page with the table between its markers."""
    begin, end = f"<!-- {name} begin -->", f"<!-- {name} end -->"
    before, _, rest = page.partition(begin)
    _, _, after = rest.partition(end)
    return f"{before}{begin}\n\n{table}\n{end}{after}"


if __name__ == "__main__":
    for file, text, name in (
        (PAGE, render_parameters(load_vehicle("bmw_i3_60ah")), "parameters"),
        (LIBRARY, render_licences(), "licences"),
    ):
        file.write_text(renewed(file.read_text(encoding="utf-8"), text, name), encoding="utf-8")
