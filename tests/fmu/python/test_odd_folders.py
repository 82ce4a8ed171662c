"""The PythonFMU kind where folders have names beyond ASCII: programs here avoid them, the export says so."""

import tempfile
import zipfile
from collections.abc import Callable
from pathlib import Path

import pytest
from slender_vehicle import make_slender_files

from strainfmu.fmu.checks.crosscheck import crosscheck
from strainfmu.fmu.export import ExportOptions, export_estimator

Run = Callable[..., tuple[int, str, str]]


def test_crosscheck_unzips_where_python_fmus_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """With folders for temporary files as those of a user Jürgen."""
    make_slender_files(tmp_path)
    fmu = tmp_path / "python.fmu"
    export_estimator(tmp_path / "map.h5", fmu, ExportOptions(kind="python"))
    odd = tmp_path / "Jürgen (1)"
    odd.mkdir()
    for name in ("TMPDIR", "TEMP", "TMP"):
        monkeypatch.setenv(name, str(odd))
    monkeypatch.setattr(tempfile, "tempdir", str(odd))
    results = crosscheck(fmu, odd / "folder")
    fmpy_result = next(result for result in results if result.importer.startswith("FMPy"))
    assert fmpy_result.outcome == "passed", fmpy_result.line


@pytest.mark.fast
@pytest.mark.parametrize("kind", ["native", "python"])
def test_the_export_says_where_it_does_not_run(tmp_path: Path, run: Run, kind: str) -> None:
    make_slender_files(tmp_path)
    fmu = tmp_path / "Jürgen" / "one.fmu"
    fmu.parent.mkdir()
    code, out, err = run("export", tmp_path / "map.h5", "--kind", kind, "-o", fmu)
    assert (code, err) == (0, "")
    assert ("note: The path of the folder that a host unzips it to may hold letters from A to Z" in out) == (
        kind == "python"
    )
    with zipfile.ZipFile(fmu) as archive:
        page = archive.read("documentation/index.html").decode()
        assert ("may hold letters from A to Z" in page) == (kind == "python")
