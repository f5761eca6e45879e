"""Run the code of the documentation's pages and draw their figures anew: python docs/render_pages.py."""

import doctest
import re
import sys
from pathlib import Path

DOCS = Path(__file__).resolve().parent
_NUMBER = re.compile(r"-?\d+\.\d+(?:e[+-]?\d+)?")


class NearlyEqual(doctest.OutputChecker):
    """Compares what a page prints, with 1 % of room for decimal numbers: processors differ in the last digits."""

    def check_output(self, want: str, got: str, optionflags: int) -> bool:
        """Whether the words are the same and the numbers nearly so."""
        wanted, found = _NUMBER.findall(want), _NUMBER.findall(got)
        near = len(wanted) == len(found) and all(
            abs(float(a) - float(b)) <= 0.01 * max(abs(float(a)), 0.01)
            for a, b in zip(wanted, found, strict=True)
        )
        return near and super().check_output(_NUMBER.sub("#", want), _NUMBER.sub("#", got), optionflags)


def render(page: Path, folder: Path) -> doctest.TestResults:
    """Run the code of a page; its figures go to `folder`.

    Parameters
    ----------
    page : Path
        A Markdown page with interpreter sessions.
    folder : Path
        Where figures are written.

    Returns
    -------
    doctest.TestResults
        Failed and attempted examples.
    """
    test = doctest.DocTestParser().get_doctest(
        page.read_text(encoding="utf-8"), {"folder": folder}, page.name, str(page), 0
    )
    for example in test.examples:
        if example.want.rstrip().endswith("```"):  # a fence right after the output is no output
            example.want = example.want.rstrip()[:-3]
    flags = doctest.NORMALIZE_WHITESPACE | doctest.ELLIPSIS
    return doctest.DocTestRunner(NearlyEqual(), optionflags=flags).run(test)


if __name__ == "__main__":
    results = [render(page, DOCS / "images") for page in sorted(DOCS.glob("*.md"))]
    sys.exit(any(result.failed for result in results))
