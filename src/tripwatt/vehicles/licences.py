"""Licences under which the values of a car may be passed on.

A car's TOML names the licence of every source that it cites:

- `[licences]` lists, for each licence, how its sources begin: ``"Apache-2.0" = ["NREL FASTSim"]``,
- `licence = "user"` at the top of the file holds for every source that `[licences]` does not list,
- `licence = "..."` in an entry holds for this entry.

A source text may cite several works, separated by "; ". A part that begins like no listed source belongs to the previous
work.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Final

from tripwatt.errors import Fault
from tripwatt.files import shipped_toml

LICENCES: Final[Mapping[str, str]] = shipped_toml("vehicles/data/table/licences.toml")
"""Licences that a car's TOML may name, by SPDX identifier if there is one."""

JOINT: Final = " AND "
"""Separator of the licences of an entry that cites several works."""


def licence_faults(expression: object, place: str) -> Iterator[Fault]:
    """Yield a fault for each unknown licence in a text of one licence, or of several joined by " AND ".

    Examples
    --------
    >>> [fault.got for fault in licence_faults("facts AND Apache-2", "car.toml")]
    ['Apache-2']
    """
    for name in str(expression).split(JOINT):
        if name not in LICENCES:
            yield Fault("unknown licence", place, name or "nothing", ", ".join(LICENCES))


def with_licences(document: Mapping[str, Any], where: str, faults: list[Fault]) -> dict[str, Any]:
    """Return the document with a licence in every entry that has a source, without the keys `licence` and `licences`.

    Parameters
    ----------
    document : mapping
        A parsed TOML, before it inherits entries from other files.
    where : str
        Name of the file in messages.
    faults : list of Fault
        Faults are appended to this list: unknown licences, and one fault for all sources without a licence.

    Examples
    --------
    >>> car = {"licences": {"facts": ["EPA"]}, "body": {"curb_mass_kg": {"source": "EPA list"}}}
    >>> with_licences(car, "car.toml", [])["body"]["curb_mass_kg"]["licence"]
    'facts'
    """
    table = _sources(document.get("licences", {}), f"{where}, [licences]", faults)
    default = document.get("licence", "")
    if default:
        faults += licence_faults(default, f"{where}, licence")
    missing: list[str] = []

    def with_licence(value: object) -> Any:
        if not isinstance(value, Mapping):
            return value
        if "source" not in value:
            return {key: with_licence(inner) for key, inner in value.items()}
        source = str(value["source"]).strip()
        licence = value.get("licence") or _licence(source, table) or default
        if source and not licence:
            missing.append(source)
        return {**value, "licence": licence} if licence else dict(value)

    own = {key: with_licence(v) for key, v in document.items() if key not in ("licence", "licences")}
    if missing:
        got = f"no licence for {missing[0]!r}" + (f" and {len(missing) - 1} more" if len(missing) > 1 else "")
        fix = 'write licence = "user" at the top of your own file, or list the sources under [licences]'
        faults.append(Fault("missing licence", where, got, "a licence for every source", fix))
    return own


def _sources(raw: object, place: str, faults: list[Fault]) -> Mapping[str, str]:
    """Return beginnings of sources with their licences, the longest beginnings first."""
    table: dict[str, str] = {}
    for licence, sources in (raw if isinstance(raw, Mapping) else {"": raw}).items():
        if not isinstance(sources, Sequence) or isinstance(sources, str) or not all(map(_is_text, sources)):
            allowed = '"Apache-2.0" = ["how a source begins", ...]'
            faults.append(Fault("not a list of sources", f"{place}, {licence}", repr(sources), allowed))
            continue
        faults += licence_faults(licence, place)
        table |= dict.fromkeys(sources, str(licence))
    return dict(sorted(table.items(), key=lambda item: -len(item[0])))


def _is_text(value: object) -> bool:
    return isinstance(value, str) and bool(value.strip())


def _licence(source: str, table: Mapping[str, str]) -> str:
    """Return the joined licences of the works that a source text cites; empty if its first work is not listed."""
    parts = source.split("; ")
    names = [next((table[s] for s in table if part.startswith(s)), "") for part in parts]
    return JOINT.join(dict.fromkeys(name for name in names if name)) if names[0] else ""
