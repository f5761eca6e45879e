"""XML texts as events, without document types, so that no entity can be declared; depth is bounded."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Mapping
from typing import Final
from xml.parsers import expat

from tripwatt.errors import InvalidInput

DEEPEST_XML: Final = 64
ROOT_BYTES: Final = 65_536
"""The root of a text begins within its first bytes."""

Start = Callable[[str, Mapping[str, str]], object]


class _Found(Exception):
    """The root is read."""


def local_name(tag: str) -> str:
    """The name of an element without its prefix.

    Examples
    --------
    >>> local_name("gx:Track"), local_name("kml")
    ('Track', 'kml')
    """
    return tag.rpartition(":")[2]


def read_events(
    data: bytes,
    name: str,
    root: str,
    *,
    on_start: Start,
    on_end: Callable[[str], object],
    on_text: Callable[[str], object],
) -> None:
    """Call functions for the elements and the texts of an XML text, in its order. O(bytes).

    Parameters
    ----------
    data : bytes
    name : str
        For messages.
    root : str
        Name of the outermost element.
    on_start, on_end, on_text : callable
        Take the name of an element without prefix and its attributes, the name alone, a part of the text between.

    Raises
    ------
    InvalidInput
        For a text that is not well-formed, has a document type, another root, or is nested too deeply.
    """
    depth = 0
    format_name = root.upper()

    def refuse(*_: object) -> None:
        allowed = f"{format_name} without a document type declaration"
        raise InvalidInput.of("XML with a document type declaration", name, "<!DOCTYPE ...>", allowed)

    def start(tag: str, attributes: Mapping[str, str]) -> None:
        nonlocal depth
        tag = local_name(tag)
        if depth == 0 and tag != root:
            raise InvalidInput.of(f"not {format_name}", name, f"<{tag[:40]}>", f"<{root}>")
        depth += 1
        if depth > DEEPEST_XML:
            got, allowed = f"{depth} levels", f"at most {DEEPEST_XML}"
            raise InvalidInput.of("XML nested too deeply", name, got, allowed)
        on_start(tag, attributes)

    def end(tag: str) -> None:
        nonlocal depth
        depth -= 1
        on_end(local_name(tag))

    parser = expat.ParserCreate()
    parser.buffer_text = True
    parser.StartElementHandler = start
    parser.EndElementHandler = end
    parser.CharacterDataHandler = on_text
    parser.StartDoctypeDeclHandler = parser.EntityDeclHandler = refuse
    try:
        parser.Parse(data, True)
    except (expat.ExpatError, ValueError, LookupError) as error:  # the latter two for encodings
        allowed = f"a {format_name} document"
        raise InvalidInput.of("not well-formed XML", name, str(error)[:120], allowed) from error


def root_of(data: bytes) -> str:
    """Name of the outermost element of an XML text, without its prefix; empty where it cannot be read.

    Examples
    --------
    >>> root_of(b'<?xml version="1.0"?><kml xmlns="http://www.opengis.net/kml/2.2"><Document/></kml>')
    'kml'
    """
    found = []

    def start(tag: str, _: Mapping[str, str]) -> None:
        found.append(local_name(tag))
        raise _Found

    parser = expat.ParserCreate()
    parser.StartElementHandler = start
    with contextlib.suppress(_Found, expat.ExpatError, ValueError, LookupError):
        parser.Parse(data[:ROOT_BYTES], False)
    return found[0] if found else ""
