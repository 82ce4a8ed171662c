"""TOML files read entry by entry: each is checked as it is taken, and what is left over is unknown."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf, isfinite
from pathlib import Path
from typing import Any

from strainfmu.errors import InputError
from strainfmu.text_files import read_toml


@dataclass
class TomlTable:
    """A table of a file that is used up entry by entry, so that what is left over is unknown."""

    path: Path
    name: str
    entries: dict[str, Any]

    def fault(self, key: str, text: str) -> InputError:
        where = f"{self.name}.{key}" if self.name else key
        return InputError(f"{self.path}: {where}: {text}")

    def number(self, key: str, default: float | None, low: float = -inf, high: float = inf) -> float:
        """Take a number from ``low`` to ``high``; without a default it must be there."""
        value = self.entries.pop(key, default)
        if value is None:
            raise self.fault(key, "entry is missing")
        numeric = isinstance(value, int | float) and not isinstance(value, bool)
        if not numeric or not isfinite(value) or not low <= value <= high:
            bounds = "" if low == -inf and high == inf else f" from {low:g} to {high:g}"
            raise self.fault(key, f"expected a number{bounds}, got {value!r}")
        return float(value)

    def integer(self, key: str, default: int, high: int) -> int:
        """Take a whole number from 0 to ``high``."""
        value = self.entries.get(key, default)
        if not isinstance(value, int) or isinstance(value, bool):
            raise self.fault(key, f"expected a whole number, got {value!r}")
        return int(self.number(key, default, 0, high))

    def text(self, key: str, default: str | None = None) -> str:
        """Take a text that is not empty."""
        value = self.entries.pop(key, default)
        if value is None:
            raise self.fault(key, "entry is missing")
        if not isinstance(value, str) or not value:
            raise self.fault(key, f"expected text, got {value!r}")
        return value

    def table(self, key: str) -> TomlTable:
        """Take a table, empty if there is none."""
        value = self.entries.pop(key, {})
        if not isinstance(value, dict):
            raise self.fault(key, f"expected a table, got {value!r}")
        return TomlTable(self.path, f"{self.name}.{key}" if self.name else key, dict(value))

    def tables(self, key: str) -> list[TomlTable]:
        """Take an array of tables."""
        value = self.entries.pop(key, [])
        if not isinstance(value, list) or not all(isinstance(item, dict) for item in value):
            raise self.fault(key, "expected an array of tables")
        return [TomlTable(self.path, f"{key}.{k}", dict(item)) for k, item in enumerate(value, start=1)]

    def finish(self) -> None:
        """Refuse what was not taken."""
        for key in self.entries:
            raise self.fault(key, "unknown entry")


def read_table(path: Path) -> TomlTable:
    """Return the table of a whole TOML file.

    Raises
    ------
    InputError
        The file is missing or no TOML.
    """
    return TomlTable(path, "", read_toml(path))
