"""What to cite, as BibTeX, from CITATION.cff: ``python -m tools.docs.write_citation``."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

import yaml  # type: ignore[import-untyped]  # its stubs are no dependency

from tools import ROOT
from tools.docs import pages

KINDS: Final[Mapping[str, str]] = {"software": "software", "article": "article", "data": "dataset"}
"""Kind of CITATION.cff -> kind of entry; those that BibTeX lacks are of BibLaTeX."""


def entry(key: str, work: Mapping[str, Any]) -> str:
    """A work of CITATION.cff as BibTeX.

    Examples
    --------
    >>> print(entry("a", {"type": "article", "title": "T", "authors": [{"given-names": "A", "family-names": "B"}], "year": 2024}))
    @article{a,
      title = {{T}},
      author = {B, A},
      year = {2024},
    }
    """
    people = [
        f"{{{who['name']}}}" if "name" in who else f"{who['family-names']}, {who['given-names']}"
        for who in work["authors"]
    ]
    arxiv = [i["value"] for i in work.get("identifiers", ()) if str(i["value"]).startswith("arXiv:")]
    fields = {
        "title": f"{{{work['title']}}}",
        "author": " and ".join(people),
        "year": str(work.get("year") or work["date-released"])[:4],
        "version": work.get("version"),
        "publisher": work.get("publisher", {}).get("name"),
        "journal": f"{arxiv[0]}" if arxiv else None,
        "doi": work.get("doi"),
        "url": work.get("url") or work.get("repository-code"),
    }
    lines = [f"  {name} = {{{value}}}," for name, value in fields.items() if value]
    return "\n".join([f"@{KINDS[work['type']]}{{{key},", *lines, "}"])


def bibtex() -> str:
    """Software, paper and data as one block of a page."""
    cited = yaml.safe_load((ROOT / "CITATION.cff").read_text("utf-8"))
    names = [f"{work['authors'][0]['family-names'].lower()}{work['year']}" for work in cited["references"]]
    works = [
        entry(key, work)
        for key, work in zip(("tripwatt", *names), (cited, *cited["references"]), strict=True)
    ]
    return "```bibtex\n" + "\n\n".join(works) + "\n```"


def main() -> None:
    """Renew the part `bibtex` of docs/reference/citing.md."""
    pages.renew("reference/citing.md", "bibtex", bibtex())


if __name__ == "__main__":
    main()
