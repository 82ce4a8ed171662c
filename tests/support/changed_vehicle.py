"""Vehicle files with entries changed, and how one that is wrong is refused."""

from pathlib import Path

import pytest

from builder.vehicle.file import IC3X, Vehicle, load_vehicle
from strainfmu.errors import InputError

TEXT = IC3X.read_text(encoding="utf-8")


def replaced(text: str, *changes: tuple[str, str]) -> str:
    """Return ``text`` with texts that must be there replaced, the first time only."""
    for old, new in changes:
        assert old in text, old
        text = text.replace(old, new, 1)
    return text


def change(path: Path, *changes: tuple[str, str]) -> None:
    """Replace texts in a file, as :func:`replaced`."""
    path.write_text(replaced(path.read_text(encoding="utf-8"), *changes), encoding="utf-8")


def write_changed(folder: Path, *changes: tuple[str, str], source: Path = IC3X) -> Path:
    """Write the shipped file, or another ``source``, with texts replaced once each."""
    path = folder / "vehicle.toml"
    path.write_text(replaced(source.read_text(encoding="utf-8"), *changes), encoding="utf-8")
    return path


def load_changed(folder: Path, *changes: tuple[str, str]) -> Vehicle:
    """Load the shipped file with texts replaced once each."""
    return load_vehicle(write_changed(folder, *changes))


def refusal(folder: Path, *changes: tuple[str, str], source: Path = IC3X) -> str:
    """Return why the shipped file, or another ``source``, is refused with texts replaced once each."""
    path = write_changed(folder, *changes, source=source)
    with pytest.raises(InputError) as caught:
        load_vehicle(path)
    return str(caught.value)
