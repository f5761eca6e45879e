"""The forecast of a trip: before departure and on the way, with its uncertainty and the energy by cause.

`__init__.pyi` lists the names. Each name is imported on first use.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
