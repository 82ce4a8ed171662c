"""``strainfmu inspect`` and ``strainfmu crosscheck`` of FMUs."""

import zipfile
from collections.abc import Callable
from pathlib import Path

import fmpy
import pytest
from fmu_host import STRAINS
from synthetic_vehicle import N_GAUGES, SyntheticFiles

from strainfmu.errors import InputError, StrainfmuError
from strainfmu.estimator.map.inverse_map import SCHEMA, SCHEMA_VERSION
from strainfmu.files import content_hash_of
from strainfmu.fmu.checks.crosscheck import (
    ImporterResult,
    check_results,
    crosscheck,
    failure_message,
    largest_deviation,
)
from strainfmu.fmu.checks.importers import read_table
from strainfmu.fmu.checks.integrity import damaged_entries

FOREIGN = """<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName="Foreign [x]" guid="{1}" generationTool="another tool">
 <ModelExchange modelIdentifier="Foreign"/>
 <ModelVariables><ScalarVariable name="a[1]" valueReference="0" causality="parameter" variability="fixed">
  <Real start="2.5"/></ScalarVariable></ModelVariables>
 <ModelStructure/>
</fmiModelDescription>
"""


Run = Callable[..., tuple[int, str, str]]


@pytest.mark.parametrize(
    ("kind", "words"),
    [
        (
            "native",
            ["2.0, model exchange, co-simulation", "kind           native", "linux64", "resources/map.bin", "C_N"],
        ),
        (
            "native_3",
            [
                "3.0, model exchange, co-simulation",
                "x86_64-linux",
                f"strain[{N_GAUGES}]",
                "0.0 ..",
                "coefficients[5]",
            ],
        ),
        ("python", ["kind           python", "linux64, win64", "resources/map.h5", "HealthState"]),
    ],
)
def test_an_estimator_is_shown(
    run: Run, synthetic: SyntheticFiles, fmus: dict[str, Path], kind: str, words: list[str]
) -> None:
    code, printed, _ = run("inspect", fmus[kind])
    assert code == 0
    shared = [content_hash_of(synthetic.map_1, SCHEMA, SCHEMA_VERSION), "dynamic_pressure_std", "95.8e3"]
    description = fmpy.read_model_description(str(fmus[kind]))
    shared[-1] = description.guid or description.instantiationToken
    for word in (*words, *shared, "synthetic vehicle 1 <&>", "tunable parameter", "documentation/index.html"):
        assert word in printed


def test_a_foreign_fmu_is_shown(run: Run, tmp_path: Path) -> None:
    path = tmp_path / "foreign.fmu"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("modelDescription.xml", FOREIGN)
    code, printed, _ = run("inspect", path)
    assert code == 0
    for word in ("Foreign [x]", "2.0, model exchange", "another tool", "a[1]", "2.5", "none: sources only"):
        assert word in printed


@pytest.mark.parametrize("content", [b"", b"no zip", None])
def test_what_is_no_fmu_is_refused_in_one_line(run: Run, tmp_path: Path, content: bytes | None) -> None:
    path = tmp_path / "a.fmu"
    if content is not None:
        path.write_bytes(content)
    code, _, error = run("inspect", path)
    assert (code, error.count("\n")) == (2, 1)
    assert ("no such FMU" if content is None else "damaged, or not an FMU") in error


RESOURCES = {"native": "resources/map.bin", "native_3": "resources/map.bin", "python": "resources/map.h5"}


def altered(source: Path, target: Path, name: str) -> Path:
    """Copy an FMU with one bit of the entry ``name`` changed; the archive's own check sums are right."""
    with zipfile.ZipFile(source) as old, zipfile.ZipFile(target, "w") as new:
        for entry in old.namelist():
            content = old.read(entry)
            new.writestr(
                entry, content[:1000] + bytes([content[1000] ^ 1]) + content[1001:] if entry == name else content
            )
    return target


@pytest.mark.parametrize("kind", RESOURCES)
def test_a_wrong_check_sum_of_a_map_is_told(run: Run, fmus: dict[str, Path], tmp_path: Path, kind: str) -> None:
    """What the FMU states is shown all the same."""
    path = altered(fmus[kind], tmp_path / "a.fmu", RESOURCES[kind])
    code, printed, error = run("inspect", path)
    assert code == 2
    line = f"strainfmu: {path}: {RESOURCES[kind]}: damaged or altered, its check sum is wrong\n"
    assert error == line
    assert "synthetic vehicle 1" in printed
    assert damaged_entries(fmus[kind]) == []


def test_a_wrong_check_sum_of_the_archive_is_told(fmus: dict[str, Path], tmp_path: Path) -> None:
    """Of a plain file and of the plant's model; all of them are listed."""
    path = tmp_path / "a.fmu"
    names = ["documentation/index.html", "sources/buildDescription.xml"]
    with zipfile.ZipFile(fmus["native"]) as archive:
        at = {name: archive.getinfo(name).header_offset + 30 + len(name) + 20 for name in names}
    content = bytearray(fmus["native"].read_bytes())
    for position in at.values():
        content[position] ^= 1
    path.write_bytes(content)
    assert damaged_entries(path) == [
        f"{name}: damaged or altered, its check sum is wrong" for name in sorted(names)
    ]
    assert damaged_entries(fmus["plant"]) == []


@pytest.mark.parametrize("kind", ["native", "python"])
def test_crosscheck_tells_what_the_fmu_says(fmus: dict[str, Path], tmp_path: Path, kind: str) -> None:
    path = altered(fmus[kind], tmp_path / "a.fmu", RESOURCES[kind])
    result = next(one for one in crosscheck(path, tmp_path / "out") if one.importer.startswith("FMPy"))
    words = "damaged or altered since it was written" if kind == "python" else "is damaged: its checksum is wrong"
    assert result.outcome == "failed"
    assert f"{RESOURCES[kind]}{':' if kind == 'python' else ''} {words}" in result.detail
    assert "Failed to instantiate" in result.detail
    assert "\n" not in result.detail
    assert result.line in (tmp_path / "out" / "Readme.txt").read_text()


def test_the_last_words_of_an_fmu_are_told() -> None:
    output = "[OK] fine\n[ERROR] first\n[FATAL] second,\n of two lines\n[OK] end\n"
    assert failure_message(output, "Traceback\nE: x\n") == "second, of two lines (E: x)"
    assert failure_message("[OK] fine", "Traceback\nE: x\n") == "E: x"
    assert failure_message("", "") == "no message"


@pytest.mark.parametrize("kind", ["native", "native_3"])
def test_a_crosscheck_folder_is_complete(fmus: dict[str, Path], tmp_path: Path, kind: str) -> None:
    results = crosscheck(fmus[kind], tmp_path)
    name = "StrainLoadEstimator"
    files = {f"{name}.fmu", f"{name}_in.csv", f"{name}_ref.csv", f"{name}_ref.opt", "Readme.txt"}
    assert {path.name for path in tmp_path.iterdir()} == files
    assert (tmp_path / f"{name}.fmu").read_bytes() == fmus[kind].read_bytes()
    options = dict(line.split(",") for line in (tmp_path / f"{name}_ref.opt").read_text().splitlines())
    assert options == {"StartTime": "0", "StopTime": "10", "StepSize": "0.25", "RelTol": "1e-05"}
    inputs = read_table(tmp_path / f"{name}_in.csv")
    assert list(inputs) == ["time", *(["strain"] if kind == "native_3" else STRAINS), "dynamic_pressure"]
    fmpy_result = next(result for result in results if result.importer.startswith("FMPy"))
    assert fmpy_result.outcome == "passed"
    readme = (tmp_path / "Readme.txt").read_text()
    for result in results:
        assert result.line in readme
        assert result.outcome != "failed"


def test_a_result_that_differs_is_found() -> None:
    reference = {"time": [[0.0], [1.0]], "a": [[2.0, 1.0], [4.0, 1.0]], "b": [[0.0], [0.0]]}
    assert largest_deviation(reference, reference)[0] == 0.0
    off = {**reference, "a": [[2.0, 1.0], [4.0, 1.4]]}
    assert largest_deviation(off, reference) == (pytest.approx(0.1), "a")
    assert largest_deviation({**reference, "a": [[], []]}, reference)[0] == float("inf")
    assert largest_deviation({**reference, "b": [[0.0], [float("nan")]]}, reference) == (float("inf"), "b")
    assert largest_deviation({"time": reference["time"]}, reference)[0] == float("inf")
    results = [ImporterResult("A 1", "passed", ""), ImporterResult("B 2", "failed", "")]
    with pytest.raises(StrainfmuError, match="cross-check: B 2 failed"):
        check_results(results)
    check_results(results[:1])


def test_an_fmu_without_a_reference_run_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "foreign.fmu"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("modelDescription.xml", FOREIGN)
    with pytest.raises(InputError, match="holds no reference run"):
        crosscheck(path, tmp_path / "none")
    assert not (tmp_path / "none").exists()


@pytest.mark.parametrize("contents", ["[1, 2]", '{"validity": 3}', "null"])
def test_entries_of_another_make_are_refused_in_one_line(run: Run, tmp_path: Path, contents: str) -> None:
    path = tmp_path / "foreign.fmu"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("modelDescription.xml", FOREIGN)
        archive.writestr("extra/strainfmu/contents.json", contents)
    code, _, error = run("inspect", path)
    assert (code, error.count("\n")) == (2, 1)
    assert "extra/strainfmu/contents.json: damaged" in error


@pytest.mark.parametrize(
    ("reference", "words"),
    [
        ("", "not a table with a column 'time'"),
        ('"a"\n1\n', "not a table with a column 'time'"),
        ('"time"\nx\n', "not a table with a column 'time'"),
        ('"time","a"\n0,1\n', "expected at least 2 points in time, got 1"),
    ],
)
def test_a_reference_run_that_is_none_is_refused(tmp_path: Path, reference: str, words: str) -> None:
    path = tmp_path / "foreign.fmu"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("modelDescription.xml", FOREIGN)
        archive.writestr("extra/org.fmi-standard.fmi-ls-ref/reference_in.csv", '"time"\n0\n1\n')
        archive.writestr("extra/org.fmi-standard.fmi-ls-ref/reference_out.csv", reference)
    with pytest.raises(InputError, match=words):
        crosscheck(path, tmp_path / "none")
    assert not (tmp_path / "none").exists()


def test_the_name_of_a_model_is_no_path(tmp_path: Path) -> None:
    """Whatever an FMU calls itself, its files stay in the folder."""
    path = tmp_path / "foreign.fmu"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("modelDescription.xml", FOREIGN.replace("Foreign [x]", "../../evil"))
        for which in ("in", "out"):
            name = f"extra/org.fmi-standard.fmi-ls-ref/reference_{which}.csv"
            archive.writestr(name, '"time","a[1]"\n0,1\n1,1\n')
    crosscheck(path, tmp_path / "a" / "b")
    assert not list(tmp_path.glob("evil*"))
    assert (tmp_path / "a" / "b" / "_.._evil.fmu").is_file()
