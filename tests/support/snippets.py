"""Code blocks of Markdown pages, with what a comment ahead of a block says of running it.

<!-- snippet: skip: REASON -->    not run
<!-- snippet: slow -->            run by the slow test of the page only
<!-- snippet: file NAME -->       its text is written to NAME
<!-- snippet: fails CODE -->      it must end with that exit code
<!-- snippet: background -->      it runs beside the next block and is then interrupted
<!-- snippet: clone -->           run in a clone of its own, by a slow test
"""

import re
from dataclasses import dataclass, replace
from pathlib import Path

ROOT = Path(__file__).parents[2]

RUN = ("sh", "python")
"""Languages of blocks that are run."""

KINDS = ("skip", "slow", "file", "fails", "background", "clone")

_FENCE = re.compile(r"^(?P<fence>`{3,}|:{3,})(?P<language>[\w{}:-]*)(?: .*)?$")
_MARK = re.compile(r"^<!-- snippet: (?P<kind>\w+):?\s*(?P<value>.*?)\s*-->$")


@dataclass(frozen=True)
class Snippet:
    """One block.

    Attributes
    ----------
    page : path from the root of the repository.
    line : of its first line, from 1.
    language : as written behind the fence.
    text : its lines.
    kind : one of :data:`KINDS`, or "run".
    value : what stands behind the kind.
    output : the block of text that follows it with nothing between, which it prints; None for none.
    """

    page: str
    line: int
    language: str
    text: str
    kind: str
    value: str
    output: str | None = None

    def __str__(self) -> str:
        return f"{self.page}:{self.line}"


def pages() -> list[Path]:
    """Return README and every page of the documentation that is written by hand."""
    docs = ROOT / "docs"
    written = [p for p in sorted(docs.rglob("*.md")) if not {"_build", "gallery", "generated"} & set(p.parts)]
    return [ROOT / "README.md", *written]


def snippets(page: Path) -> list[Snippet]:
    """Return the blocks of ``page`` that are run, written to a file, or marked."""
    blocks, marks = [], ("run", "")
    fence, language, start, lines, follows = "", "", 0, [], False
    for number, line in enumerate(page.read_text(encoding="utf-8").splitlines(), start=1):
        if fence:
            if line.strip() == fence:
                if language == "text" and follows and marks == ("run", ""):
                    blocks[-1] = replace(blocks[-1], output="\n".join(lines) + "\n")
                blocks.append(_snippet(page, start, language, lines, marks))
                fence, marks, follows = "", ("run", ""), language in RUN
            else:
                lines.append(line)
            continue
        opening, mark = _FENCE.match(line), _MARK.match(line)
        if opening and opening["fence"].startswith("`"):
            fence, language, start, lines = opening["fence"], opening["language"], number + 1, []
        elif mark:
            marks = (mark["kind"], mark["value"])
        elif line.strip() and not line.startswith("<!--"):
            marks, follows = ("run", ""), False
    return [snippet for snippet in blocks if snippet.language in RUN or snippet.kind != "run"]


def _snippet(page: Path, line: int, language: str, lines: list[str], marks: tuple[str, str]) -> Snippet:
    name = page.relative_to(ROOT).as_posix()
    return Snippet(name, line, language, "\n".join(lines) + "\n", *marks)
