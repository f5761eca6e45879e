"""Where physics meets statistics: simulated energy plus a learned correction.

`cumulative` corrects the cumulative energy, as the paper does; `power` corrects the power of short blocks from what
is known before departure. In both ``residual = observed - simulated`` and ``predicted = simulated + correction``.
"""

from tripwatt.hybrid.blocks import BLOCK_S, BlockTable, block_table
from tripwatt.hybrid.correctors import POWER_CORRECTORS, power_corrector
from tripwatt.hybrid.cumulative import (
    COVARIATES,
    TABLE2,
    Corrector,
    DataOnly,
    EnergyModel,
    EnergyRegression,
    HybridModel,
    IntArray,
    PhysicsOnly,
    Table2Corrector,
    TripTable,
    build_table,
)
from tripwatt.hybrid.power import PowerCorrector

__all__ = [
    "BLOCK_S",
    "COVARIATES",
    "POWER_CORRECTORS",
    "TABLE2",
    "BlockTable",
    "Corrector",
    "DataOnly",
    "EnergyModel",
    "EnergyRegression",
    "HybridModel",
    "IntArray",
    "PhysicsOnly",
    "PowerCorrector",
    "Table2Corrector",
    "TripTable",
    "block_table",
    "build_table",
    "power_corrector",
]
