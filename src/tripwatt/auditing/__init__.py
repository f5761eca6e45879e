"""Audit of logs: find what is wrong with each log, and mend, trim, split or set it aside. No model is used.

A log is not yet a trip: it may contain a freeze, a charging stop, or a sensor that stops half-way. Each rule is a small
function with named thresholds in a module of this package; `audit` applies the rules in order.

`__init__.pyi` lists the names. Each name is imported on first use.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
