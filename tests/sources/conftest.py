"""Small made-up files in the layout of the TUM set: every odd header and every kind of damage starts from these."""

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pytest

HEADER = (
    "Time [s]",
    "Velocity [km/h]",
    "Elevation [m]",
    "Throttle [%]",
    "Motor Torque [Nm]",
    "Regenerative Braking Signal ",
    "Battery Voltage [V]",
    "Battery Current [A]",
    "Battery Temperature [°C]",
    "SoC [%]",
    "displayed SoC [%]",
    "max. SoC [%)",
    "Heating Power CAN [kW]",
    "Requested Heating Power [W]",
    "AirCon Power [kW]",
    "Ambient Temperature [°C]",
    "Cabin Temperature Sensor [°C]",
)


def tum_lines(
    header: Sequence[str] = HEADER, rows: int = 30, delimiter: str = ";", step_s: float = 0.1
) -> list[str]:
    time = np.arange(rows) * step_s
    lines = [delimiter.join(header)]
    for i, t in enumerate(time):
        cells = [f"{t:.1f}", f"{36 + i % 7}", "571", "12", "20.5", "0", "390.5", f"{-20 - i % 5}.25", "21"]
        cells += ["86.9", "99.5", "90", "1.5", "1500", "0.4", "25.5", "24.5"]
        lines.append(delimiter.join(cells))
    return lines


@pytest.fixture
def tum_bytes() -> Callable[..., bytes]:
    def build(encoding: str = "latin-1", newline: str = "\r\n", **options: object) -> bytes:
        return (newline.join(tum_lines(**options)) + newline).encode(encoding)  # type: ignore[arg-type]

    return build


@pytest.fixture
def write_overview() -> Callable[..., Path]:
    def write(folder: Path, rows: Sequence[Sequence[object]]) -> Path:
        openpyxl = pytest.importorskip("openpyxl", reason="needs the extra tripwatt[workbooks]")
        book = openpyxl.Workbook()
        sheet = book.active
        sheet.append(
            [
                "Trip",
                "Date",
                "Route/Area",
                "Weather",
                "Target Cabin Temperature",
                None,
                "Distance [km]",
                "Duration [min]",
                None,
                "Fan",
                "Note",
            ]
        )
        for row in rows:
            sheet.append(list(row))
        path = folder / "Overview.xlsx"
        book.save(path)
        return path

    return write
