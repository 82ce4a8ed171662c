"""``strainfmu inspect`` of a structure prints what the file holds and what its layouts observe."""

import re
from collections.abc import Callable
from io import StringIO
from math import pi
from pathlib import Path

import pytest
from rich.console import Console
from structure_record import LENGTH, RADIUS, small_structure
from undrawn_figures import draw_nothing

from builder.structure.structure_file import save_structure
from strainfmu.cli.inspection.files import inspect_artefact


@pytest.fixture(scope="module")
def printed(tmp_path_factory: pytest.TempPathFactory) -> tuple[str, Path]:
    """What is printed of the small structure on a console of 120 columns, and the folder of its file."""
    folder = tmp_path_factory.mktemp("structure")
    save_structure(small_structure(), folder / "structure.h5")
    out = StringIO()
    with pytest.MonkeyPatch.context() as patch:
        draw_nothing(patch.setattr)
        inspect_artefact(folder / "structure.h5", folder / "figures", Console(file=out, width=120))
    return out.getvalue(), folder


def cells(out: str, start: str) -> list[str]:
    """Return the words of the first line that begins with ``start``."""
    line = next(line for line in out.splitlines() if line.strip().startswith(start))
    return re.split(r"\s{2,}", line.strip())


def test_what_the_file_holds(printed: tuple[str, Path]) -> None:
    out, _ = printed
    for text in ("degrees of freedom", "9876", "superlu", "BSD-3-Clause", "support, kind", "clamped"):
        assert text in out
    assert "fingerprint of the mesh" not in out
    assert cells(out, "elements, tetrahedron10") == ["elements, tetrahedron10", "1234"]
    assert cells(out, "volume") == ["volume", "0.25", "m3"]
    assert cells(out, "cos(2 phi)") == ["cos(2 phi)", "0.9991"]


def test_gauges_and_units(printed: tuple[str, Path]) -> None:
    """Under uniform pressure the waves cancel: 1e-9/(Pa m2) times the area of the 24-sided cylinder."""
    out, _ = printed
    flat = 24.0 * 2.0 * RADIUS * 0.5 * LENGTH * 2.0 * 0.13052619222005157  # 24 chords 2 R sin(pi/24), flat panels
    area = f"{flat:.3g}"
    assert flat == pytest.approx(2.0 * pi * RADIUS * LENGTH, rel=3e-3)
    assert cells(out, "axial_90") == ["axial_90", "0.5", "90", "axial", "external", "point", area, "0.0025"]
    assert cells(out, "hoop_45") == ["hoop_45", "1", "45", "hoop", "external", "3", area, "0.0025"]
    assert cells(out, "slanted [45]")[:4] == ["slanted [45]", "1.5", "200", "45.0 deg"]
    for unit in ("x [m]", "roll [deg]", "[mm]", "[um/m]"):
        assert unit in out


def test_what_the_layouts_see(printed: tuple[str, Path]) -> None:
    """Five gauges, alike along x, see five waves: 0, cos 1, sin 1, cos 2, sin 2; two at 0 and 180 deg see two."""
    out, _ = printed
    classes = [line.split() for line in out.splitlines() if " in y, " in line]
    rank = {(words[0], f"{words[1]} {words[4]}"): (words[8], words[-1] == "blind") for words in classes}
    assert rank == {
        ("first", "even even"): ("2", False),
        ("first", "even odd"): ("1", False),
        ("first", "odd even"): ("1", False),
        ("first", "odd odd"): ("1", False),
        ("second", "even even"): ("1", False),
        ("second", "even odd"): ("1", False),
        ("second", "odd even"): ("0", True),
        ("second", "odd odd"): ("0", True),
    }
    assert "they do not depend on the mesh" in " ".join(out.split())
    assert "above 1 % of the layout's largest" in " ".join(out.split())


def test_figures_are_written(printed: tuple[str, Path]) -> None:
    out, folder = printed
    for name in ("mesh_and_gauges", "strain_patterns", "waves", "singular_values"):
        path = folder / "figures" / f"{name}.png"
        assert path.read_bytes().startswith(b"\x89PNG")
        assert f"{path}: written" in out


def test_nothing_is_cut_on_a_narrow_console(
    run: Callable[..., tuple[int, str, str]], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    save_structure(small_structure(), tmp_path / "structure.h5")
    code, out, _ = run("inspect", tmp_path / "structure.h5")
    assert code == 0
    assert (tmp_path / "structure_figures" / "waves.png").exists()
    assert "…" not in out
    assert cells(out, "axial_90")[:3] == ["axial_90", "0.5", "90"]


def test_a_damaged_file_is_refused_in_one_line(run: Callable[..., tuple[int, str, str]], tmp_path: Path) -> None:
    path = tmp_path / "structure.h5"
    save_structure(small_structure(), path)
    content = bytearray(path.read_bytes())
    content[-100] ^= 0xFF
    path.write_bytes(content)
    code, out, error = run("inspect", path)
    assert code == 2
    assert not out
    assert len(error.strip().splitlines()) == 1
    assert "structure.h5" in error
    assert "damaged" in error
