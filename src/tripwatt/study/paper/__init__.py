"""The method of arXiv:2405.10984: cumulative energy simulated, its residual fitted with the trip as the cluster.

`correctors` has the paper's models, ready to fit; `insight` has the tables, residuals and effects of a fitted GAMM.
"""

from tripwatt.study.paper.models import HybridModel
from tripwatt.study.paper.table2 import TABLE2, Table2Corrector

__all__ = ["TABLE2", "HybridModel", "Table2Corrector"]
