"""Maps of a region on this machine: roads, elevation, places and charging stations, made from an OpenStreetMap extract."""
