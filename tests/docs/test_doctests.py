"""Examples in docstrings, run where a finished demonstration lies in ``demo``."""

import doctest
from importlib import import_module
from pathlib import Path

import pytest
from snippets import ROOT


def modules_with_examples() -> list[str]:
    """Return the names of the modules whose docstrings hold examples."""
    paths = [path for package in ("strainfmu", "builder") for path in sorted((ROOT / package).rglob("*.py"))]
    chosen = [path for path in paths if ">>> " in path.read_text(encoding="utf-8")]
    return [".".join(path.relative_to(ROOT).with_suffix("").parts) for path in chosen]


@pytest.mark.parametrize("name", modules_with_examples())
def test_examples(name: str, ic3x_demo: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(ic3x_demo.parent)
    result = doctest.testmod(import_module(name), optionflags=doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE)
    assert result.attempted > 0
    assert result.failed == 0
