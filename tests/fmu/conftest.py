"""FMUs of every kind, once per run, and another program that checks them."""

import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from fmu_host import OPTIONS, SCALARS, exported_kinds
from fmu_manipulation_toolbox.cli.fmutool import fmutool
from once import once
from synthetic_vehicle import SyntheticFiles
from whole_maps import MAPS

from strainfmu.fmu.export import export_estimator


@pytest.fixture(scope="session")
def fmus(synthetic: SyntheticFiles, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Return paths of estimator FMUs: of map 1 by kind and of scalars, ``kind_2`` of map 2; and of the plant."""
    made = {
        f"{kind}{end}": (source, options)
        for kind, options in OPTIONS.items()
        for end, source in (("", synthetic.map_1), ("_2", synthetic.map_2))
    } | {"scalars": (synthetic.map_1, SCALARS)}

    def export(folder: Path) -> None:
        for name, (source, options) in made.items():
            export_estimator(source, folder / f"{name}.fmu", options)

    folder = once(tmp_path_factory, "kinds", export)
    return {name: folder / f"{name}.fmu" for name in made} | {"plant": synthetic.plant}


@pytest.fixture
def checked_by_fmutool(
    monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> Callable[[Path], str]:
    """Return a function that checks an FMU with fmutool, finds no fault and returns what it printed."""

    def check(path: Path) -> str:
        monkeypatch.setattr(sys, "argv", ["fmutool", "-input", str(path), "-check"])
        assert not fmutool()
        printed = "".join(capfd.readouterr())
        assert "seems to be compliant with FMI-" in printed
        assert "No semantic error" in printed
        return printed

    return check


@pytest.fixture(scope="session")
def whole_fmus(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], dict[str, Path]]:
    """Return a function of ``linear`` or ``flight``: paths of the FMUs of that map, by kind and of scalars."""

    def of(name: str) -> dict[str, Path]:
        def export(folder: Path) -> None:
            exported_kinds(MAPS[name](), folder)
            export_estimator(folder / "map.h5", folder / "scalars.fmu", SCALARS)

        folder = once(tmp_path_factory, f"whole_{name}", export)
        return {kind: folder / f"{kind}.fmu" for kind in (*OPTIONS, "scalars")}

    return of
