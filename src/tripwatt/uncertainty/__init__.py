"""Uncertainty of a trip's energy: residual process, scale of the total, conformal scores, updates and planned routes.

`__init__.pyi` lists the names. Each name is imported on first use.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
