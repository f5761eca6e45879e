"""Where public sets of logs can be had, and under which licence."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from tripwatt.sources.tum_fetch import where_to_get_tum
from tripwatt.sources.ved import CITATION as VED_CITATION

_VED: Final = f"""\
Vehicle Energy Dataset: a year of driving in Ann Arbor, with three electric cars (Nissan Leaf), about 3 GB.

1. https://github.com/gsoh/VED, folder Data: unpack both archives of the dynamic data, and keep the weekly files in one folder.

Then `tripwatt evaluate FOLDER --dataset ved` reads the electric cars.

Licence: Apache-2.0.
{VED_CITATION}
"""

_TWIZY: Final = """\
Renault Twizy around Rabat: 17 trips of 2021, 1 Hz, without current: the energy comes from the state of charge.

1. https://github.com/NaitMalekYoussef/RSK_Twizy_EV_Dataset, folder data/Analyzed

`tripwatt mapping suggest FOLDER` writes the mapping; usable battery 6.1 kWh. Describe the car with
`tripwatt vehicles new --body quadricycle`: it has no climate control.

Licence: CC BY 4.0. Name the authors when you publish results:
Y. NaitMalek et al., https://doi.org/10.1109/ACCESS.2022.3225643 and https://doi.org/10.3390/su14169993
"""

_SEDAN: Final = """\
An electric sedan on a dynamometer (46 runs) and on the road around Changchun (104 trips), 2023.

1. https://github.com/MOTIVES-LAB/generalized-energy-consumption-evaluation-for-ev

`tripwatt mapping suggest FOLDER` writes the mapping; use --vehicle tesla_model_3_lr.

Licence: the repository names MIT, its page non-commercial, educational and research purposes. Name the authors when you publish results:
Yuan et al., Patterns 5(4), 2024, https://doi.org/10.1016/j.patter.2024.100950
"""

PUBLIC_SETS: Final[Mapping[str, str]] = {
    "tum": where_to_get_tum(),
    "ved": _VED,
    "twizy": _TWIZY,
    "sedan": _SEDAN,
}
"""Name of a set -> where it can be had."""
