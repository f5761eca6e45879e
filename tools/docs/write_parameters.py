"""Renew the table of a car's values in docs/explanation/car-model.md and that of licences in docs/reference/vehicles.md.

Run ``python -m tools.docs.write_parameters`` after a change of a car or of the licences.
"""

from tools.docs import pages
from tripwatt.vehicles import load_vehicle, render_licences, render_parameters


def main() -> None:
    """Renew both tables."""
    pages.renew("explanation/car-model.md", "parameters", render_parameters(load_vehicle("bmw_i3_60ah")))
    pages.renew("reference/vehicles.md", "licences", render_licences())


if __name__ == "__main__":
    main()
