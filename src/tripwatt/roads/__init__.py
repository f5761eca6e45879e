"""From A to B: maps, routers, places, weather, journeys with stops, advice on a road."""
