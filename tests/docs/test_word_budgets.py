"""Length and words of pages, help and code: sections keep within budgets, sentences are short, words plain."""

import ast
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

import pytest
from rooms import files, nodes_of
from snippets import ROOT, pages
from typer.main import get_command

from strainfmu.cli.commands import program

pytestmark = pytest.mark.fast

BUDGETS = {
    "README": 510,
    "start": 670,
    "tutorials": 2_040,
    "howto": 12_400,
    "explanation": 8_480,
    "evidence": 2_210,
    "reference": 5_720,
    "developers": 1_940,
}
"""Words written by hand in each section; "start" is the first page of the site and of its sections."""

LONGEST_SENTENCE = 35
"""Words of a sentence of README, start page, tutorials, how-to and help."""

AVOIDED = {
    "that of": r"\b(?:that|those) of\b",
    "in place of": r"in place of",
    "beside": r"\bbeside\b",
    "told, tells": r"\b(?:told|tells?)\b",
    "believed": r"\bbelieved\b",
    "held to": r"\bheld to\b",
    "let": r"\blet\b",
    "anew": r"\banew\b",
    "whichever": r"\bwhichever\b",
    "without a word": r"\bwithout a word\b",
    "be it": r"\bbe it\b",
    "least": r"(?<!at )\bleast\b(?![ -]squares)",
    "share": r"\b(?:a|an|the|this|same|of|what) shares?\b(?! an?\b)",
    "at a third": r"\bat a third\b",
    "of like": r"\bof like\b",
    "further": r"\bfurther (?:parameters?|sensors?|loads?)\b",
    "errs by": r"\berrs? by\b",
    "strains": r"\bstrains (?:the|its|all|by|gauges)\b",
    "deviation": r"(?<![Ss]tandard )\bdeviations?\b",
}
"""What does not belong in prose, by its name: an expression that finds it."""

AVOIDED_IN_HELP = {**AVOIDED, "manifold": r"\bmanifold\b", "taken off": r"\btaken off\b"}
"""The same of the help, which users read without the rest."""

PACKAGES = ("builder", "fmus", "strainfmu")
"""Folders of the product's Python code."""

EXCEPTIONS: dict[str, str] = {
    "least significant": "the name of a bit",
}
"""What stays in a string of the code with such a word in it, and why."""

PROGRAM: Any = get_command(program())  # annotated as a command; an app of several is a group
COMMANDS: dict[str, Any] = {"strainfmu": PROGRAM, **PROGRAM.commands}
"""The program and its commands, of typer's click, by name."""


def prose(text: str) -> str:
    """Return what is written by hand, without front matter, comments, code fences; 0 for a formula in a line."""
    kept, fence = [], ""
    for line in re.sub(r"\A---\n.*?\n---\n", "", text, flags=re.S).splitlines():
        opening = re.match(r"\s*(`{3,}|~{3,})", line)
        if fence:
            fence = "" if line.strip() == fence else fence
        elif opening:
            fence = opening[1]
        else:
            kept.append(line)
    written = re.sub(r"<!--.*?-->|\$\$.*?\$\$", "", "\n".join(kept), flags=re.S)
    return re.sub(r"\$[^$\n]*\$", "0", written)


def words(text: str) -> int:
    """Return the number of words; numbers are none."""
    return sum(re.search(r"[A-Za-z]", token) is not None for token in text.split())


def section_of(page: Path) -> str:
    """Return the section that the words of a page count for."""
    if page.parent == ROOT:
        return "README"
    return "start" if page.name == "index.md" else page.relative_to(ROOT / "docs").parts[0]


def paragraphs(text: str) -> Iterator[str]:
    """Yield paragraphs and items of lists, each in one line, without headings, tables, labels and directives."""
    lines: list[str] = []
    for line in [*prose(text).splitlines(), ""]:
        begins = re.match(r"\s*(?:[-*]|\d+\.)\s+", line)
        other = not line.strip() or re.match(r"\s*(?:\||#|:|!\[|\([\w-]+\)=$)", line)
        if lines and (begins or other):
            yield " ".join(lines)
            lines = []
        if begins:
            lines.append(line[begins.end() :])
        elif not other:
            lines.append(line.strip())


def sentences(text: str) -> Iterator[str]:
    """Yield the sentences of the paragraphs."""
    for paragraph in paragraphs(text):
        plain = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", paragraph)  # of a link, what is read
        yield from re.split(r"(?<=[^.][.!?:])[*_)\"]*\s+(?=[\"`*\[(]*[A-Z0-9`])", plain)


def avoided(text: str, expressions: dict[str, str] = AVOIDED) -> dict[str, str]:
    """Return the avoided words in ``text``, each with the last place it stands in."""
    text = " ".join(text.split())
    hits = [(word, hit.span()) for word, pattern in expressions.items() for hit in re.finditer(pattern, text)]
    return {word: text[max(first - 40, 0) : last + 40] for word, (first, last) in hits}


@cache
def strings(path: Path) -> list[tuple[int, str]]:
    """Return line and text of the docstrings and of all other strings with a space; a code span is one letter."""
    return [
        (node.lineno, re.sub(r"``[^`]*``|(?::[a-z]+:)?`[^`]*`", "x", node.value))
        for node in nodes_of(path)
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and " " in node.value.strip()
    ]


def sources(*packages: str) -> list[Path]:
    return [path for path in files() if path.suffix == ".py" and path.parts[0] in packages]


def help_texts(command: str) -> Iterator[str]:
    """Yield the paragraphs of a command's help without its examples, and the help of its parameters."""
    for paragraph in (COMMANDS[command].help or "").split("\n\n"):
        if not paragraph.startswith(" "):
            yield paragraph
    yield from (getattr(one, "help", None) or "" for one in COMMANDS[command].params)


def name(page: Path) -> str:
    return page.relative_to(ROOT).as_posix()


@pytest.mark.parametrize("section", BUDGETS)
def test_a_section_keeps_within_its_budget(section: str) -> None:
    counted = {
        name(page): words(prose(page.read_text("utf-8"))) for page in pages() if section_of(page) == section
    }
    assert counted
    assert sum(counted.values()) <= BUDGETS[section], counted


def test_every_page_belongs_to_a_section() -> None:
    assert {section_of(page) for page in pages()} == set(BUDGETS)


@pytest.mark.parametrize("page", pages(), ids=name)
def test_sentences_are_short(page: Path) -> None:
    if section_of(page) not in ("README", "start", "tutorials", "howto"):
        return
    long = [one for one in sentences(page.read_text("utf-8")) if words(one) > LONGEST_SENTENCE]
    assert long == []


@pytest.mark.parametrize("page", pages(), ids=name)
def test_words_are_plain(page: Path) -> None:
    assert avoided(re.sub(r"`[^`\n]*`|\]\([^)\n]*\)", "", prose(page.read_text("utf-8")))) == {}


@pytest.mark.parametrize("package", PACKAGES)
def test_words_of_the_code_are_plain(package: str) -> None:
    found: dict[str, dict[str, str]] = {}
    for path in sources(package):
        for line, text in strings(path):
            for kept in EXCEPTIONS:
                text = text.replace(kept, "")
            if hits := avoided(text):
                found[f"{path.as_posix()}:{line}"] = hits
    assert found == {}


def test_exceptions_are_still_needed() -> None:
    assert all(avoided(kept) for kept in EXCEPTIONS)
    if EXCEPTIONS:
        written = "\n".join(text for path in sources(*PACKAGES) for _, text in strings(path))
        assert [kept for kept in EXCEPTIONS if kept not in written] == []


@pytest.mark.parametrize("command", COMMANDS)
def test_paragraphs_of_the_help_are_one_line_of_short_sentences_in_plain_words(command: str) -> None:
    for text in help_texts(command):
        assert "\n" not in text
        assert [one for one in sentences(text) if words(one) > LONGEST_SENTENCE] == []
        assert avoided(text, AVOIDED_IN_HELP) == {}


def test_the_rules_find_what_they_are_for(tmp_path: Path) -> None:
    text = "A b. C *d*\n\n| e | f |\n\n- g\n  h\n- i: J k\n\n```sh\nx y z\n```\n\nThe [l m](n.md) is $p q$ 1 r.\n"
    assert list(sentences(text)) == ["A b.", "C *d*", "g h", "i:", "J k", "The l m is 0 1 r."]
    assert words(prose(text)) == 16
    bad = "the strain is that of a wall and strains the gauges by a share of 2 deviations at the least"
    assert {word for word, pattern in AVOIDED.items() if re.search(pattern, bad)} == {
        "that of",
        "share",
        "strains",
        "deviation",
        "least",
    }
    assert not any(re.search(p, "at least two standard deviations by least squares") for p in AVOIDED.values())
    assert not any(re.search(p, "least-squares gradient") for p in AVOIDED.values())
    code = tmp_path / "code.py"
    code.write_text('"""One\n``that`` of two."""\nA = "one"\nB = f"in place {A} of it"\nC = "that " "of"\n')
    hits = {line: sorted(avoided(text)) for line, text in strings(code)}
    assert hits == {1: [], 4: [], 5: ["that of"]}
    assert next(help_texts("estimate")).startswith("Estimate")
