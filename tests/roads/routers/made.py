"""The straight road of `tests.support.roads` and a Valhalla router that answers with it."""

import math

from tests.support.roads import client, valhalla

from tripwatt.roads.routers import ValhallaRouter
from tripwatt.routes.places import Place

NO = math.nan

EXACT = {"rtol": 1e-9, "atol": 1e-9}

A, MIDDLE, B = Place(47.0, 9.0), Place(47.0, 9.05), Place(47.0, 9.1)

HALF_M = 6371008.8 * math.radians(0.05) * math.cos(math.radians(47.0))
"""Length of half of the straight road; a parallel, which the great circle undercuts by less than a metre."""


def valhalla_at(server):
    """A router that sends its questions to a client of a server."""
    return ValhallaRouter(lambda action, document: server.post_json(f"/{action}", document))


def valhalla_router(**answers):
    """A router with a Valhalla server for the straight road; a keyword replaces the answer of an action."""
    return valhalla_at(client(valhalla(**answers)))
