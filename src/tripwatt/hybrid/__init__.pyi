from .correctors import POWER_CORRECTORS, STORABLE, power_corrector
from .identification import Identified, StageRecord, identify, identify_each, stage_record
from .outside import Corrector
from .power import PowerCorrector
from .segments import SegmentTable, resimulated, segment_table, segment_trips
from .trip_table import EnergyModel, EnergyRegression, PhysicsOnly, TripTable, build_table

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
    "identify_each",
    "power_corrector",
    "resimulated",
    "segment_table",
    "segment_trips",
    "stage_record",
]
