"""The HTTP service and the page, of the extra `tripwatt[service]`.

The service returns the same forecasts as the command line. `app` defines the endpoints of the one process that handles
HTTP; that process computes no forecasts. `pool` runs the `jobs` in worker processes. Every request passes `middleware`
and `protocol`. `schemas` describes requests and responses. `docs/reference/service.md` describes how to run the service.
"""
