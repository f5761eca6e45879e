"""Planned trips from links, recorded tracks or router responses, and the speed over time of a driver on them.

`__init__.pyi` lists the names. Each name is imported on first use.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
