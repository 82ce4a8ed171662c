"""FMUs that were damaged or altered, or lie in odd folders: one clear message of the FMU, never a crash."""

import zipfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from fmu_host import COEFFICIENTS, STRAINS, loaded

from strainfmu.cosim.systems.instance import Instance, read_description, unzip
from strainfmu.errors import StrainfmuError

pytestmark = pytest.mark.fast

Change = Callable[[bytes], bytes | None]


def rewritten(source: Path, target: Path, name: str, change: Change) -> Path:
    """Copy an FMU with the entry ``name`` changed, or left out where ``change`` returns None."""
    with zipfile.ZipFile(source) as old, zipfile.ZipFile(target, "w") as new:
        for entry in old.namelist():
            content: bytes | None = old.read(entry)
            if entry == name and content is not None:
                content = change(content)
            if content is not None:
                new.writestr(entry, content)
    return target


def flipped(position: int) -> Change:
    """Return a change of one bit at ``position``."""
    return lambda content: content[:position] + bytes([content[position] ^ 1]) + content[position + 1 :]


MAP_CHANGES: dict[str, tuple[Change, str, str]] = {
    "cut": (lambda content: content[: len(content) // 2], "cut or extended", "damaged or altered"),
    "extended": (lambda content: content + b"\0" * 8, "cut or extended", "damaged or altered"),
    "empty": (lambda _: b"", "no map of an FMU", "damaged"),
    "altered": (flipped(1000), "checksum is wrong", "damaged or altered"),
    "of another kind": (flipped(0), "no map of an FMU", "damaged"),
    "missing": (lambda _: None, "cannot be opened", "no such file"),
}


@pytest.mark.parametrize("kind", ["native", "python"])
@pytest.mark.parametrize("change", MAP_CHANGES)
def test_a_damaged_map_is_refused_with_a_reason(
    fmus: dict[str, Path], tmp_path: Path, kind: str, change: str
) -> None:
    alter, native_reason, python_reason = MAP_CHANGES[change]
    name = "resources/map.bin" if kind == "native" else "resources/map.h5"
    fmu = rewritten(fmus[kind], tmp_path / "a.fmu", name, alter)
    refused(fmu, tmp_path, native_reason if kind == "native" else python_reason)


def refused(fmu: Path, folder: Path, reason: str) -> None:
    """Assert that the FMU cannot be instantiated, and reports why."""
    unzip(fmu, folder / "unzipped")
    with pytest.raises(StrainfmuError, match=reason) as caught:
        Instance("x", fmu, read_description(fmu), folder / "unzipped")
    assert "\n" not in str(caught.value)


def test_a_map_of_another_format_version_is_refused(fmus: dict[str, Path], tmp_path: Path) -> None:
    fmu = rewritten(fmus["native"], tmp_path / "a.fmu", "resources/map.bin", flipped(8))
    refused(fmu, tmp_path, "format version 9, must be 8")


def test_a_description_that_is_not_the_maps_is_refused(fmus: dict[str, Path], tmp_path: Path) -> None:
    """The guid ties both together; so a map from another FMU is refused too."""
    fmu = rewritten(
        fmus["native"],
        tmp_path / "a.fmu",
        "modelDescription.xml",
        lambda content: content.replace(b'guid="{', b'guid="{0'),
    )
    refused(fmu, tmp_path, "guid")
    with zipfile.ZipFile(fmus["native_2"]) as archive:
        other = archive.read("resources/map.bin")
    fmu = rewritten(fmus["native"], tmp_path / "b.fmu", "resources/map.bin", lambda _: other)
    (tmp_path / "other").mkdir()
    refused(fmu, tmp_path / "other", "guid")


@pytest.mark.parametrize("folder", ["with blanks", "mü", "a+b", "(1)", "100%", "a#b", "x" * 200])
def test_the_native_kind_runs_from_any_folder(fmus: dict[str, Path], tmp_path: Path, folder: str) -> None:
    with loaded(fmus["native"], tmp_path / folder / folder) as host:
        host.initialize()
        host.set(STRAINS, 1e-5 * np.arange(1.0, len(STRAINS) + 1.0))
        assert abs(host.get(COEFFICIENTS)).max() > 0.0
