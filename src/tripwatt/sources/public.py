"""Where public sets of logs can be had, and under which licence."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from types import MappingProxyType

from tripwatt.files import shipped_toml
from tripwatt.sources import tum, ved


@cache
def public_sets() -> Mapping[str, str]:
    """Name of a set -> where it can be had, from `public.toml`.

    Examples
    --------
    >>> text = public_sets()["tum"]
    >>> "10.21227/6jr9-5235" in text and "CC BY 4.0" in text
    True
    """
    citations = {"tum": tum.CITATION, "ved": ved.CITATION}
    return MappingProxyType(
        {
            name: str(about["where"]).replace("CITATION", citations.get(name, ""))
            for name, about in shipped_toml("sources/public.toml").items()
        }
    )
