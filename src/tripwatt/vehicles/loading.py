"""Names, search and loading of cars, from the library and from TOML files."""

from __future__ import annotations

import dataclasses
import difflib
import re
import types
import unicodedata
from collections.abc import Mapping, Sequence
from functools import cache, lru_cache
from pathlib import Path
from typing import Any

from tripwatt.errors import InvalidInput, excerpt, require_type
from tripwatt.files import MAX_TEXT_BYTES, parse_toml, read_text_file
from tripwatt.vehicles.anchors import anchors, with_anchor
from tripwatt.vehicles.catalogue import catalogue, charging_section, class_values, table_names
from tripwatt.vehicles.inheriting import DATA, bundled_document
from tripwatt.vehicles.reading import vehicle_from_document
from tripwatt.vehicles.similar import figures_of_row, similar_document
from tripwatt.vehicles.vehicle import Vehicle


@cache
def vehicle_names() -> tuple[str, ...]:
    """Return the names of the cars that come with the package, sorted.

    Examples
    --------
    >>> "bmw_i3_60ah" in vehicle_names()
    True
    """
    return tuple(sorted({*file_names(), *table_names()}))


@cache
def file_names() -> tuple[str, ...]:
    """Return the names of the library cars that have a TOML, sorted."""
    return tuple(sorted(file.stem for file in DATA.glob("*.toml")))


def load_vehicle(
    name_or_path: str | Path, preset: str = "default", overrides: Mapping[str, float | str] | None = None
) -> Vehicle:
    """Load a car that comes with the package, or one from a TOML file.

    Parameters
    ----------
    name_or_path : str or Path
        A name from `vehicle_names()`, or the path of a TOML file.
    preset : str
        "default", "paper", or a preset of the file.
    overrides : mapping of str to (float or str), optional
        "section.key" or a short name of `tripwatt.vehicles.ALIASES` -> value in the unit of the entry, e.g.
        ``{"auxiliaries.base_load_w": 400.0, "mass": 1300.0}``. Overrides of a part that the preset leaves out
        have no effect.

    Returns
    -------
    Vehicle
        Its parts, and the origin of every value.

    Raises
    ------
    InvalidInput
        With every fault of the file, the preset and the overrides.

    Examples
    --------
    >>> load_vehicle("bmw_i3_60ah", preset="paper").regeneration.fraction
    0.5
    """
    allowed = "a Vehicle, the name of one, or a TOML file"
    path = Path(require_type("car", name_or_path, str | Path, allowed))
    if path.suffix != ".toml":
        if overrides := require_type("overrides", overrides or {}, Mapping, "a Mapping"):
            return _from_library(str(name_or_path), preset, overrides)
        vehicle = _unchanged(str(name_or_path), f"{preset}")
        return dataclasses.replace(vehicle, entries=dict(vehicle.entries))
    text = read_text_file(path, MAX_TEXT_BYTES, what="file cannot be read", allowed="a TOML text file")
    document = parse_toml(text, str(path))
    # values in a user's file have the licence of the user and are anchored to no test, unless the file says otherwise
    document = {"licence": "user", "anchor": "class", **document}
    return vehicle_from_document(document, path.stem, str(path), preset, overrides or {})


def _from_library(name: str, preset: str, overrides: Mapping[str, float | str]) -> Vehicle:
    require_vehicle(name)
    document = with_anchor(library_document(name), anchors().get(name))
    return vehicle_from_document(document, name, f"{name}.toml", preset, overrides)


@lru_cache(maxsize=256)
def _unchanged(name: str, preset: str) -> Vehicle:
    """Load a library car without overrides, cached because reading takes 10 ms. Only its `entries` can be changed: copy them."""
    return _from_library(name, preset, {})


def require_vehicle(name: str, others: Sequence[str] = ()) -> None:
    """Raise `InvalidInput` if a name is not in `vehicle_names()`, and suggest similar names.

    Parameters
    ----------
    name : str
        Name of a bundled car.
    others : sequence of str
        Further names to suggest, such as those of a user's cars.

    Raises
    ------
    InvalidInput
        If the name is not in `vehicle_names()`.

    Examples
    --------
    >>> require_vehicle("bmw_i3_60ah")
    """
    if name in vehicle_names():
        return
    near = find_vehicles(name) or difflib.get_close_matches(name, (*others, *vehicle_names()), n=3)
    described = "or describe it: `tripwatt vehicles new`, the path of a .toml file, over HTTP its figures"
    fix = f"did you mean {' or '.join(map(repr, near[:3]))}?" if near else described
    allowed = f"one of {len(vehicle_names())} names, listed by `tripwatt vehicles` and GET /v1/vehicles"
    raise InvalidInput.of("unknown car", "vehicle", excerpt(name), allowed, fix)


@cache
def vehicle_titles() -> Mapping[str, str]:
    """Return the title of every car of the library by its name, without loading the cars.

    Examples
    --------
    >>> vehicle_titles()["vw_id3"]
    'Volkswagen ID.3 58 kWh'
    """
    titles = {name: str(bundled_document(name)["name"]) for name in file_names()}
    titles |= {name: catalogue()[name]["title"][0].value for name in table_names()}
    return types.MappingProxyType({name: titles[name] for name in vehicle_names()})


def find_vehicles(words: str) -> tuple[str, ...]:
    """Find the cars whose title or name contains all of some words. O(cars).

    Parameters
    ----------
    words : str
        Words in any order; a year matches the cars that were made in it. Punctuation and case do not count: "model3 2022" finds
        the Model 3 of 2022. A word of one or two letters has to be a whole word of title or name, alone or together with the
        word before or after it ("ev 6"); a longer word may also begin at any word and span several.

    Returns
    -------
    tuple of str
        Names of cars; empty if no words are given. The order is by the number of words that match only a beginning, by the
        length of the title without its years, then by title.

    Examples
    --------
    >>> find_vehicles("kona 64")
    ('hyundai_kona_64',)
    """
    wanted = [word for word in map(_plain, words.split()) if word]
    around = zip(["", *wanted], wanted, [*wanted[1:], ""], strict=False)
    searched = [(word, before + word, word + after) for before, word, after in around]
    matching = []
    for name, title in vehicle_titles().items():
        texts = [_plain(word) for word in re.split(r"[\s_.()/-]+", f"{title} {name}")]
        rests = ["".join(texts[k:]) for k in range(len(texts))]
        if wanted and all(
            forms[0] in texts
            or _is_year_of(forms[0], title)
            or any(len(form) > 2 and rest.startswith(form) for form in forms for rest in rests)
            for forms in searched
        ):
            parts = sum(word not in texts for word in wanted)
            matching.append((parts, len(title.partition(" (")[0]), title, name))
    return tuple(name for *_, name in sorted(matching))


def _plain(text: str) -> str:
    """Keep letters and digits of a text, in lower case and without accents."""
    plain = unicodedata.normalize("NFKD", text.lower())
    return "".join(sign for sign in plain if sign.isascii() and sign.isalnum())


def _is_year_of(word: str, title: str) -> bool:
    """Return whether a word is a model year of a car, which are in brackets at the end of its title."""
    match = re.search(r"\((\d{4})(?:-(\d{4}))?\)$", title)
    return match is not None and len(word) == 4 and match[1] <= word <= (match[2] or match[1])


def library_document(name: str) -> dict[str, Any]:
    """Return the document of a car of the library, before anchoring.

    Parameters
    ----------
    name : str
        One of `vehicle_names()`.
    """
    if name in file_names():
        return {**bundled_document(name), **charging_section(name)}
    return {**similar_document(figures_of_row(catalogue()[name]), class_values()), **charging_section(name)}
