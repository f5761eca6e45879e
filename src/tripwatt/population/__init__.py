"""Models for cars: for a model's own car, for another car without trips, and for one with a few trips.

`__init__.pyi` lists the names. Each name is imported on first use.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
