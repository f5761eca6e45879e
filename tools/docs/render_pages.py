"""Run the code of the documentation's pages and draw their figures anew: python -m tools.docs.render_pages.

With `--write`, what the code prints replaces what the pages show. Each page runs in a folder of its own, so that it can write
files.
"""

import contextlib
import doctest
import io
import re
import sys
import tempfile
from pathlib import Path

from tools import DOCS

_NUMBER = re.compile(r"-?\d+\.\d+(?:e[+-]?\d+)?")


class NearlyEqual(doctest.OutputChecker):
    """Compares what a page prints, with 1 % of room for decimal numbers: processors differ in the last digits."""

    def check_output(self, want: str, got: str, optionflags: int) -> bool:
        """Whether the words are the same and the numbers nearly so."""
        expected, printed = _NUMBER.findall(want), _NUMBER.findall(got)
        near = len(expected) == len(printed) and all(
            abs(float(a) - float(b)) <= 0.01 * max(abs(float(a)), 0.01)
            for a, b in zip(expected, printed, strict=True)
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


def with_output(page: Path, folder: Path) -> str:
    """Return a page with the output of its code as it is now.

    Parameters
    ----------
    page : Path
        A Markdown page with interpreter sessions.
    folder : Path
        Where figures are written.

    Returns
    -------
    str
        The page. Lines that are not output stay as they are.
    """
    text = page.read_text(encoding="utf-8")
    lines, names, shown, position = text.splitlines(), {"folder": folder, "__name__": "__main__"}, [], 0
    for example in doctest.DocTestParser().get_examples(text):
        end = example.lineno + example.source.count("\n")
        want = example.want.rstrip("\n").split("\n") if example.want else []
        printed = io.StringIO()
        with contextlib.redirect_stdout(printed):
            exec(compile(example.source, page.name, "single"), names)  # it is ours
        shown += lines[position:end]
        shown += [
            line or "<BLANKLINE>"
            for line in printed.getvalue().rstrip("\n").split("\n")
            if printed.getvalue()
        ]
        position = end + len(want) - (1 if want and want[-1].strip() == "```" else 0)
    return "\n".join([*shown, *lines[position:], ""])


def pages() -> list[Path]:
    """The pages with interpreter sessions."""
    return [page for page in sorted(DOCS.rglob("*.md")) if ">>> " in page.read_text(encoding="utf-8")]


if __name__ == "__main__":
    failed = 0
    for path in pages():
        with tempfile.TemporaryDirectory() as place, contextlib.chdir(place):
            if "--write" in sys.argv:
                path.write_text(with_output(path, DOCS / "images"), encoding="utf-8")
            else:
                failed += render(path, DOCS / "images").failed
    sys.exit(failed > 0)
