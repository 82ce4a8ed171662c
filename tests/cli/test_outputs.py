"""No command writes over a file that it reads."""

import inspect
from collections.abc import Callable
from pathlib import Path

import pytest

from strainfmu.cli.commands import program
from strainfmu.written_files import WRITTEN

pytestmark = pytest.mark.fast

Run = Callable[..., tuple[int, str, str]]

READS = {
    "calibrate": ("map.h5", "test.toml"),
    "equations": ("test.toml",),
    "channels": ("map.h5", "flight.csv"),
    "dbc": ("map.h5",),
    "estimate": ("map.h5", "flight.csv"),
    "export": ("map.h5",),
    "loadtest": ("vehicle.toml",),
    "picture": ("map.h5",),
    "place": ("vehicle.toml",),
    "plant": ("map.h5",),
    "replay": ("run.blf", "map.h5"),
    "review": ("vehicle.toml",),
    "snapshots": ("vehicle.toml",),
    "structure": ("vehicle.toml",),
    "surface": ("vehicle.toml",),
    "tare": ("map.h5", "ground.csv", "--window", "0:1"),
}
"""Arguments of the commands that write one file."""


@pytest.mark.parametrize("command", READS)
def test_an_output_that_is_an_input_is_refused(
    command: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, run: Run
) -> None:
    """Under another name too, before anything is read; the input stays as it is."""
    monkeypatch.chdir(tmp_path)
    files = [name for name in READS[command] if "." in name]
    for name in files:
        Path(name).write_text("input")
    (tmp_path / "link").symlink_to(tmp_path)
    for output in (files[0], f"link/{files[-1]}"):
        code, _, errors = run(command, *READS[command], "-o", output)
        assert (code, errors) == (
            2,
            f"strainfmu: {output}: --output: expected another file than those that are read\n",
        )
    assert {Path(name).read_text() for name in files} == {"input"}


@pytest.mark.parametrize("command", [*READS, "build", "compare", "demo", "stress"])
def test_an_output_in_a_file_is_refused(command: str, tmp_path: Path, run: Run) -> None:
    """No folder can be made there; that is said before the work."""
    (tmp_path / "file").write_text("kept")
    output = tmp_path / "file" / "folder" / "out.h5"
    arguments = READS.get(command, () if command == "demo" else ("none.toml",))
    code, _, errors = run(command, *arguments, "-o", output)
    assert (code, errors) == (
        2,
        f"strainfmu: {output}: --output: expected a path in folders, got the file {tmp_path / 'file'} instead of"
        " one\n",
    )
    assert (tmp_path / "file").read_text() == "kept"


def test_the_report_of_a_calibration_never_takes_its_map(tmp_path: Path, run: Run) -> None:
    """Both names are checked before anything is read."""
    (tmp_path / "folder.html").mkdir()
    for name, line in (
        ("o.html", "o.html: --output: expected another suffix than .html, which is the report's"),
        ("folder.h5", "folder.html: is a folder, must be a file"),
    ):
        code, _, errors = run("calibrate", "none.h5", "none.toml", "-o", tmp_path / name)
        assert (code, errors) == (2, f"strainfmu: {tmp_path}/{line}\n")


def test_two_outputs_are_two_files(tmp_path: Path, run: Run) -> None:
    one = str(tmp_path / "zeros.toml")
    code, _, errors = run("tare", "none.h5", "none.csv", "--window", "0:1", "-o", one, "--known-output", one)
    assert (code, "expected another file than the others that are written" in errors) == (2, True)


def test_all_commands_that_write_a_file_are_tried() -> None:
    """All others write a folder, whose default has no suffix; ``bench`` writes a table, with ``--mesh`` alone."""
    others = {"bench", "convert"}
    writing = set()
    for info in program().registered_commands:
        assert info.callback is not None
        parameters = inspect.signature(info.callback).parameters
        default = parameters["output"].default if "output" in parameters else None
        if default is inspect.Parameter.empty or (isinstance(default, Path) and default.suffix):
            writing.add(info.callback.__name__)
    assert writing - others == set(READS)
    assert "output" in WRITTEN
