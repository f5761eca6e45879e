"""Vehicle files of other programs as the text of a car's TOML: ``python -m tools.data.import_vehicle FILE``.

Read are those of NREL FASTSim (YAML of version 3, YAML and CSV of version 2) and Eclipse SUMO (XML of its MMPEVEM model).
What such a file does not hold comes from shared data, from similarity with a bundled car, or from a stated estimate; each
entry says which. Motor efficiency and loss maps of the source are not taken over.
"""

from __future__ import annotations

import sys
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Final

from tools.command import run
from tools.data.importing.fastsim import from_fastsim_csv, from_fastsim_yaml
from tools.data.importing.rendering import vehicle_toml
from tools.data.importing.stated import Stated
from tools.data.importing.sumo import from_sumo
from tripwatt.errors import InvalidInput
from tripwatt.files import read_text_file
from tripwatt.vehicles import vehicle_from_document

LARGEST_FILE_BYTES: Final = 20_000_000
"""Vehicle files are far smaller; larger ones are refused unread."""


def import_vehicle(path: str | Path, row: str | None = None) -> str:
    """Text of a car's TOML for a vehicle file of FASTSim (.yaml, .yml, .csv) or SUMO MMPEVEM (.xml).

    Parameters
    ----------
    path : str or Path
        The vehicle file.
    row : str, optional
        For a CSV table with many vehicles: the scenario name or number of one. For an XML with many vehicle types:
        the id of one.

    Returns
    -------
    str
        Text of a TOML that `load_vehicle` reads.

    Raises
    ------
    InvalidInput
        With everything that the file lacks or that cannot be used.

    Examples
    --------
    >>> print(import_vehicle("2022_Renault_Zoe.yaml"))  # doctest: +SKIP
    """
    file = Path(path)
    readers: dict[str, Callable[[str, str, str | None], Stated]] = {
        ".yaml": from_fastsim_yaml,
        ".yml": from_fastsim_yaml,
        ".csv": from_fastsim_csv,
        ".xml": from_sumo,
    }
    reader = readers.get(file.suffix.lower())
    if reader is None:
        raise InvalidInput.of("unknown file format", str(file), file.suffix, ", ".join(readers))
    text = read_text_file(file, LARGEST_FILE_BYTES, what="file cannot be read", allowed="a text file")
    stated = reader(text, str(file), row)
    result = vehicle_toml(stated, file.name)
    vehicle_from_document(tomllib.loads(result), file.stem, str(file))  # impossible values show here
    return result


def main(path: str, row: str = "", out: str = "") -> int:
    """Print the TOML of a vehicle file of FASTSim or SUMO, or write it to `--out`; `--row` names the vehicle in a file with several."""
    try:
        text = import_vehicle(path, row or None)
    except InvalidInput as error:
        print(error, file=sys.stderr)
        return 2
    if out:
        Path(out).write_text(text, encoding="utf-8")
    else:
        print(text, end="")
    return 0


if __name__ == "__main__":
    run(main)
