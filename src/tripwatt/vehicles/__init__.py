"""Cars as frozen dataclasses, one TOML per car: value, unit and source for every entry."""
