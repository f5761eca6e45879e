"""Find the words of a map that a mistyped word may mean, by their first letters.

If two words differ by one letter too many, too few, wrong or swapped among their first letters, they become equal when one of these
letters is deleted from each (symmetric deletion, W. Garbe, SymSpell, 2012). The index has every word under each of these keys, so that a
search reads only a few keys, whatever the number of words.
"""

from __future__ import annotations

import sqlite3
from collections.abc import Iterable
from typing import Final

FIRST_LETTERS: Final = 5
SHORTEST: Final = 4
LONGEST: Final = 30
"""Mistakes are searched only in words with `SHORTEST` to `LONGEST` letters."""

MAX_MISTAKES: Final = 2
TWO_MISTAKES_FROM: Final = 8
"""Number of letters from which on a typed word may have two mistakes."""

MAX_COMPARED: Final = 40
"""Largest number of words of one key that are compared, those of important places first."""

MAX_NEAR: Final = 5

SCHEMA: Final = (
    "CREATE TABLE words (key TEXT, rank INTEGER, word TEXT, PRIMARY KEY (key, rank, word)) WITHOUT ROWID"
)


def keys(word: str) -> set[str]:
    """Return the keys of a word: its first letters, and these letters without each one of them.

    Examples
    --------
    >>> sorted(keys("vadutz") & keys("vaduz"))
    ['vadu']
    """
    first = word[:FIRST_LETTERS]
    return {first, *(first[:k] + first[k + 1 :] for k in range(len(first)))}


def write_words(database: sqlite3.Connection, words: Iterable[tuple[str, int]]) -> None:
    """Write words with their ranks into the index. O(words)."""
    rows = ((key, rank, word) for word, rank in words if _has_mistakes(word) for key in keys(word))
    database.executemany("INSERT OR IGNORE INTO words VALUES (?, ?, ?)", rows)


def near_words(database: sqlite3.Connection, typed: str) -> dict[str, int]:
    """Return the words of which a typed word may be a mistyped beginning, with the number of mistakes of each, the nearest first."""
    if not _has_mistakes(typed):
        return {}
    max_mistakes = 1 if len(typed) < TWO_MISTAKES_FROM else MAX_MISTAKES
    rows = {
        word: rank
        for key in keys(typed)
        for rank, word in database.execute(
            "SELECT rank, word FROM words WHERE key = ? ORDER BY rank LIMIT ?", (key, MAX_COMPARED)
        )
    }
    max_letters = len(typed) + max_mistakes
    measured = ((*mistakes(typed, word[:max_letters]), rank, word) for word, rank in rows.items())
    nearest = sorted(entry for entry in measured if 0 < entry[0] <= max_mistakes)
    return {word: begins for begins, _, _, word in nearest[:MAX_NEAR]}


def _has_mistakes(word: str) -> bool:
    return SHORTEST <= len(word) <= LONGEST and not word.isdigit()


def mistakes(typed: str, word: str) -> tuple[int, int]:
    """Count the mistakes of a typed word compared with a beginning of a word, and with the whole word. O(letters³ / 64).

    The number of mistakes is the optimal string alignment distance: the least number of letters added, left out, wrong or swapped.
    Only beginnings that are at most `MAX_MISTAKES` letters shorter than the typed word are compared.

    Examples
    --------
    >>> mistakes("schan", "schaan"), mistakes("vdau", "vaduz"), mistakes("vadu", "vaduz")
    ((1, 1), (1, 2), (0, 1))
    """
    from rapidfuzz.distance import OSA  # of the extras routing and service

    whole = OSA.distance(typed, word)
    shortest = max(len(typed) - MAX_MISTAKES, 0)
    return min([whole, *(OSA.distance(typed, word[:k]) for k in range(shortest, len(word)))]), whole
