"""The shipped vehicle file with entries changed."""

from __future__ import annotations

from pathlib import Path

from builder.vehicle.file import IC3X, Vehicle, load_vehicle

TEXT = IC3X.read_text(encoding="utf-8")


def write_changed(folder: Path, *changes: tuple[str, str]) -> Path:
    """Write the shipped file with texts replaced once each."""
    text = TEXT
    for old, new in changes:
        assert old in text, old
        text = text.replace(old, new, 1)
    path = folder / "vehicle.toml"
    path.write_text(text, encoding="utf-8")
    return path


def load_changed(folder: Path, *changes: tuple[str, str]) -> Vehicle:
    """Load the shipped file with texts replaced once each."""
    return load_vehicle(write_changed(folder, *changes))
