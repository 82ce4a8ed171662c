"""TOML files of every kind: a byte-order mark is passed over, what is no TOML is refused in one line."""

from collections.abc import Callable
from pathlib import Path

import pytest

from builder.aero.cfd.manifest import load_manifest
from builder.vehicle.file import load_vehicle
from strainfmu.can.dbc_files import load_mapping
from strainfmu.cosim.scenario import load_scenario
from strainfmu.errors import InputError

pytestmark = pytest.mark.fast

READERS = (load_vehicle, load_scenario, load_mapping, load_manifest)


def refusal(read: Callable[[Path], object], path: Path) -> str:
    """Return why a file is refused, "" if it is not."""
    try:
        read(path)
    except InputError as error:
        return str(error)
    return ""


@pytest.mark.parametrize("read", READERS)
def test_a_byte_order_mark_is_passed_over(read: Callable[[Path], object], tmp_path: Path) -> None:
    """The file is refused, if at all, for what it holds: the same with the mark as without."""
    path = tmp_path / "file.toml"
    path.write_text("unknown = 1\n", encoding="utf-8")
    plain = refusal(read, path)
    path.write_text("unknown = 1\n", encoding="utf-8-sig")
    assert refusal(read, path) == plain
    assert "TOML" not in plain


@pytest.mark.parametrize("read", READERS)
@pytest.mark.parametrize(
    "content",
    [b"a = ", b"\xff\xfea", b"a = " + b"[" * 5000, b"a = " + b"9" * 5000, b"a = 1\na = 2", b"\x00"],
    ids=["cut", "utf-16", "deep", "long number", "twice", "zero"],
)
def test_what_is_no_toml_is_refused_in_one_line(
    read: Callable[[Path], object], content: bytes, tmp_path: Path
) -> None:
    path = tmp_path / "file.toml"
    path.write_bytes(content)
    message = refusal(read, path)
    assert message.startswith(str(path))
    assert "\n" not in message
