"""Where physics meets statistics: simulated energy, and a correction fitted to its error.

`trip_table` holds trips sample by sample, and `segments` in short time bins; `power` corrects the power of segments from
quantities known before departure. In both, ``residual = observed - simulated`` and ``predicted = simulated + correction``.
"""

from tripwatt.hybrid.correctors import POWER_CORRECTORS, STORABLE, power_corrector
from tripwatt.hybrid.identification import Identified, StageRecord, identify, stage_record
from tripwatt.hybrid.outside import Corrector
from tripwatt.hybrid.power import PowerCorrector
from tripwatt.hybrid.segments import SegmentTable, resimulated, segment_table, segment_trips
from tripwatt.hybrid.trip_table import EnergyModel, EnergyRegression, PhysicsOnly, TripTable, build_table

__all__ = [
    "POWER_CORRECTORS",
    "STORABLE",
    "Corrector",
    "EnergyModel",
    "EnergyRegression",
    "Identified",
    "PhysicsOnly",
    "PowerCorrector",
    "SegmentTable",
    "StageRecord",
    "TripTable",
    "build_table",
    "identify",
    "power_corrector",
    "resimulated",
    "segment_table",
    "segment_trips",
    "stage_record",
]
