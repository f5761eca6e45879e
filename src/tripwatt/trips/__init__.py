"""Drives as data: a `Log` before its audit, a `Trip` after it, a `Plan` of a drive to come, and what is known at the `Departure`.

`__init__.pyi` lists the names. Each name is imported on first use, so that the help of the command line, which needs the table of
departure fields, does not import pandas.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
