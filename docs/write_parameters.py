"""Renew the table of a car's values in docs/model.md: ``python docs/write_parameters.py``."""

from pathlib import Path

from tripwatt.vehicles import load_vehicle, render_parameters

PAGE = Path(__file__).with_name("model.md")
BEGIN, END = "<!-- parameters begin -->", "<!-- parameters end -->"


def renewed(page: str) -> str:
    """The page with the table of now."""
    before, _, rest = page.partition(BEGIN)
    _, _, after = rest.partition(END)
    table = render_parameters(load_vehicle("bmw_i3_60ah"))
    return f"{before}{BEGIN}\n\n{table}\n{END}{after}"


if __name__ == "__main__":
    PAGE.write_text(renewed(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
