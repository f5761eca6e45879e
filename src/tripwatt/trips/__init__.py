"""Drives as data: `Log` as it came, `Trip` after its audit, `Plan` to come, and what is known at the `Departure`.

`__init__.pyi` lists the names. Each is imported when it is used, since the help of the command line needs the table of a departure
but not pandas.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
