"""Where physics meets statistics: simulated energy, and a correction fitted to its error.

`trip_table` holds trips sample by sample, and `segments` in short time bins; `power` corrects the power of segments from
quantities known before departure. In both, ``residual = observed - simulated`` and ``predicted = simulated + correction``.

`__init__.pyi` lists the names. Each name is imported on first use.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
