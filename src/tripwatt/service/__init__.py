"""The HTTP service and the page, of the extra `tripwatt[service]`: the same forecast as the command line's.

`app` wires one process that speaks HTTP; it computes nothing. The jobs of `jobs` run in worker processes that `crew`
keeps; `gates` is what every request passes. `docs/service.md` is the page for those who run it.
"""
