"""FMUs of every kind against the checkers and schemas that can be had."""

import re
import subprocess
import zipfile
from collections.abc import Callable
from pathlib import Path

import fmpy
import pytest
from fmpy.validation import validate_fmu
from lxml import etree

import strainfmu.archive
from strainfmu.fmu.native.sources import ARITHMETIC_FLAGS

KINDS = ["native", "native_3", "scalars", "python", "plant"]
SCHEMA = Path(fmpy.__file__).parent / "schema"
LARGEST = 1750 * 1024
"""Bytes of an FMU: libraries for five platforms and the sources; with a map of fifty gauges 2 MB are allowed."""


@pytest.mark.parametrize("kind", KINDS)
def test_fmpy_finds_no_fault(fmus: dict[str, Path], kind: str) -> None:
    assert validate_fmu(str(fmus[kind])) == []


@pytest.mark.parametrize("kind", KINDS)
def test_fmutool_finds_no_fault(
    fmus: dict[str, Path], kind: str, checked_by_fmutool: Callable[[Path], str]
) -> None:
    printed = checked_by_fmutool(fmus[kind])
    assert not re.search(r"^(WARNING|ERROR|CRITICAL)", printed, re.MULTILINE)


@pytest.mark.parametrize("kind", KINDS)
def test_every_xml_follows_its_schema(fmus: dict[str, Path], kind: str) -> None:
    second = kind not in ("native_3", "scalars")
    schemas = {
        "modelDescription.xml": "fmi2/fmi2ModelDescription.xsd" if second else "fmi3/fmi3ModelDescription.xsd",
        "terminalsAndIcons/terminalsAndIcons.xml": "fmi3/fmi3TerminalsAndIcons.xsd",
    }
    if kind not in ("python", "plant"):
        schemas["sources/buildDescription.xml"] = "fmi3/fmi3BuildDescription.xsd"
    with zipfile.ZipFile(fmus[kind]) as archive:
        for name, schema in schemas.items():
            validator = etree.XMLSchema(etree.parse(str(SCHEMA / schema)))
            validator.assertValid(etree.fromstring(archive.read(name)))
        found = {name for name in archive.namelist() if name.endswith(".xml")}
    assert found - set(schemas) <= {"extra/org.fmi-standard.fmi-ls-ref/fmi-ls-manifest.xml"}


@pytest.mark.parametrize("kind", KINDS)
def test_entries_are_portable(
    fmus: dict[str, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, kind: str
) -> None:
    """Deflated or stored, no symbolic links, forward slashes, none above the root, times fixed."""
    with zipfile.ZipFile(fmus[kind]) as archive:
        for entry in archive.infolist():
            assert entry.compress_type in (zipfile.ZIP_DEFLATED, zipfile.ZIP_STORED)
            assert re.fullmatch(r"[\w.-]+(/[\w.-]+)*", entry.filename)
            assert entry.date_time == (1980, 1, 1, 0, 0, 0)
            assert entry.external_attr >> 28 == 0  # a plain file
        assert archive.namelist() == sorted(archive.namelist())
        entries = {name: archive.read(name) for name in archive.namelist()}
    monkeypatch.setattr(strainfmu.archive, "LEVEL", 6)  # tests pack quickly
    strainfmu.archive.write_archive(tmp_path / "packed.fmu", entries)
    assert (tmp_path / "packed.fmu").stat().st_size < LARGEST


def test_libraries_are_named_after_the_model_and_lie_in_folders_of_their_version(fmus: dict[str, Path]) -> None:
    for kind, folder in (("native", "linux64"), ("native_3", "x86_64-linux")):
        with zipfile.ZipFile(fmus[kind]) as archive:
            names = set(archive.namelist())
        assert f"binaries/{folder}/StrainLoadEstimator.so" in names
        assert {"resources/map.bin", "documentation/index.html", "terminalsAndIcons/icon.png"} <= names
        assert ("model.png" in names) is (kind == "native")
        other = "fmi3" if kind == "native" else "fmi2"
        assert not [name for name in names if other in name.replace("fmi-ls", "")]
        assert not [name for name in names if "Functions.h" in name or name.endswith((".lib", ".pdb", ".py"))]


@pytest.mark.parametrize("kind", ["native", "native_3"])
def test_both_ways_to_build_forbid_fused_multiply_adds(fmus: dict[str, Path], kind: str) -> None:
    with zipfile.ZipFile(fmus[kind]) as archive:
        root = etree.fromstring(archive.read("sources/buildDescription.xml"))
        recipe = archive.read("sources/library.cmake").decode()
    (files,) = root.iter("SourceFileSet")
    options = files.get("compilerOptions", "").split()
    assert files.get("compiler") == "clang"
    assert set(ARITHMETIC_FLAGS) == {"-ffp-contract=off", "-fno-math-errno"} <= set(options)
    assert all(flag in recipe for flag in ARITHMETIC_FLAGS)


@pytest.mark.parametrize("kind", ["native", "native_3"])
def test_sources_are_complete(fmus: dict[str, Path], kind: str, tmp_path: Path) -> None:
    """Every file to compile is listed, is there, and compiles with what lies beside it and the headers of FMI.

    test_build_from_sources.py makes libraries of them.
    """
    fmpy.extract(str(fmus[kind]), str(tmp_path))
    sources = tmp_path / "sources"
    described = ["sources/buildDescription.xml", *(["modelDescription.xml"] if kind == "native" else [])]
    for name in described:
        root = etree.parse(str(tmp_path / name)).getroot()
        # FMI 2.0 lists them once for each of its interfaces, too.
        listed = sorted({element.get("name") for tag in ("File", "SourceFile") for element in root.iter(tag)})
        assert listed == sorted(path.relative_to(sources).as_posix() for path in sources.rglob("*.c"))
    if kind == "native":  # which CMake builds in every run
        return
    compiler = next((c for c in ("cc", "gcc", "clang") if _runs(c)), None)
    if compiler is None:
        pytest.skip("no C compiler here")
    headers = Path(fmpy.__file__).parent / "c-code"
    (files,) = etree.parse(str(tmp_path / described[0])).getroot().iter("SourceFileSet")
    options = files.get("compilerOptions").split()
    flags = [*options, "-fsyntax-only", "-Werror=implicit-function-declaration", f"-I{headers}"]
    command = [compiler, *flags, *listed]
    done = subprocess.run(command, cwd=sources, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


def _runs(compiler: str) -> bool:
    try:
        return subprocess.run([compiler, "--version"], capture_output=True).returncode == 0
    except OSError:
        return False
