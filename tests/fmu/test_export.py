"""Packaging: reproducible, atomic, self-contained."""

import importlib
import os
import struct
import subprocess
import sys
import zipfile
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from flight_fmu import whole_map
from fmpy import read_model_description, simulate_fmu
from fmu_host import OPTIONS
from synthetic_vehicle import N_GAUGES, SyntheticFiles, write_trajectory

from strainfmu.cli.main import main
from strainfmu.cosim.models.trajectory import HEADER
from strainfmu.errors import InputError, StrainfmuError
from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.map.inverse_map import SCHEMA, SCHEMA_VERSION, load_inverse_map, save_inverse_map
from strainfmu.files import built_time_of
from strainfmu.fmu.export import ExportOptions, export_estimator, export_plant
from strainfmu.fmu.native.build import library_file
from strainfmu.fmu.native.package import processor_library
from strainfmu.fmu.python.package import with_own_package


@pytest.mark.fast
def test_equal_exports_are_equal_to_the_byte(
    synthetic: SyntheticFiles, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A vehicle's, and an estimator's after one like it has run; other kinds are compared between two machines."""
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "1700000000")
    for name in ("a", "b"):
        export_estimator(synthetic.map_1, tmp_path / f"{name}_python.fmu", OPTIONS["python"])
        export_plant(synthetic.flight_model, synthetic.trajectory, tmp_path / f"{name}_plant.fmu")
        # An FMU that ran leaves its own copy of pythonfmu in the process, without binaries to pack.
        simulate_fmu(str(tmp_path / f"{name}_python.fmu"), stop_time=0.01)
    for kind in ("python", "plant"):
        assert (tmp_path / f"a_{kind}.fmu").read_bytes() == (tmp_path / f"b_{kind}.fmu").read_bytes()


@pytest.mark.fast
def test_fmus_are_dated_as_their_data(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """By the time of the build, which no content hash holds, or by SOURCE_DATE_EPOCH; equal maps, equal bytes."""
    monkeypatch.delenv("SOURCE_DATE_EPOCH", raising=False)
    hashes = [save_inverse_map(whole_map(), tmp_path / f"{day}.h5", f"2026-05-0{day}T10:11:12Z") for day in (1, 2)]
    assert hashes[0] == hashes[1]
    for options in (*OPTIONS.values(), ExportOptions(estimator="linear")):
        export_estimator(tmp_path / "2.h5", tmp_path / "a.fmu", options)
        assert read_model_description(str(tmp_path / "a.fmu")).generationDateAndTime == "2026-05-02T10:11:12Z"
    for name in ("a", "b"):
        export_estimator(tmp_path / "1.h5", tmp_path / f"{name}.fmu")
    assert (tmp_path / "a.fmu").read_bytes() == (tmp_path / "b.fmu").read_bytes()
    save_inverse_map(whole_map(), tmp_path / "now.h5")
    now = datetime.fromisoformat(built_time_of(tmp_path / "now.h5", SCHEMA, SCHEMA_VERSION))
    assert abs(datetime.now(UTC) - now) < timedelta(minutes=5)
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "1700000000")
    export_estimator(tmp_path / "1.h5", tmp_path / "a.fmu")
    stated = "2023-11-14T22:13:20Z"
    assert read_model_description(str(tmp_path / "a.fmu")).generationDateAndTime == stated
    save_inverse_map(whole_map(), tmp_path / "now.h5")
    assert built_time_of(tmp_path / "now.h5", SCHEMA, SCHEMA_VERSION) == stated


@pytest.mark.fast
@pytest.mark.parametrize("kind", ["native", "python"])
def test_the_linear_estimator_of_a_map_with_tables(
    kind: str, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Byte for byte that of the map without tables, with model exchange; the nonlinear one says how to get it."""
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "1700000000")
    save_inverse_map(whole_map(), tmp_path / "both.h5")
    save_inverse_map(replace(whole_map(), manifold=None), tmp_path / "linear.h5")
    options = replace(OPTIONS[kind], estimator="linear")
    assert export_estimator(tmp_path / "both.h5", tmp_path / "a.fmu", options) == "linear"
    export_estimator(tmp_path / "linear.h5", tmp_path / "b.fmu", OPTIONS[kind])
    assert (tmp_path / "a.fmu").read_bytes() == (tmp_path / "b.fmu").read_bytes()
    command = ["export", str(tmp_path / "both.h5"), "--kind", options.kind, "--fmi", options.fmi_version]
    said = []
    for more in ([], ["--estimator", "linear"]):
        with pytest.raises(SystemExit):
            main([*command, *more, "-o", str(tmp_path / "c.fmu")])
        said.append(capsys.readouterr().out)
    assert ("--estimator linear has model exchange" in said[0]) == (options.kind == "native")
    assert "derivative" not in said[0]  # which every native FMU has
    assert "model exchange" not in said[1]
    assert ("cannot load it: its library has undefined symbols" in said[0]) == (options.kind == "python")


EXPORTS = """
import sys
from pathlib import Path
from strainfmu.fmu.export import ExportOptions, export_estimator
for kind in sys.argv[1:]:
    name, _, version = kind.partition("_")
    export_estimator(Path("map.h5"), Path(f"{kind}.fmu"), ExportOptions(kind=name, fmi_version=version or "2"))
"""


def test_exports_do_not_follow_the_machine(synthetic: SyntheticFiles, tmp_path: Path) -> None:
    """Equal to the byte with the kernels of two processors, in another folder, time zone and hash seed."""
    images = []
    for core, zone in (("Prescott", "UTC"), ("Haswell", "Asia/Tokyo")):
        folder = tmp_path / core
        folder.mkdir()
        copy = folder / "map.h5"
        copy.write_bytes(synthetic.map_1.read_bytes())
        command = [sys.executable, "-c", EXPORTS, *OPTIONS]
        environment = {**os.environ, "OPENBLAS_CORETYPE": core, "TZ": zone, "PYTHONHASHSEED": str(len(core))}
        subprocess.run(command, cwd=folder, env=environment, check=True, capture_output=True, timeout=60)
        images.append([(folder / f"{kind}.fmu").read_bytes() for kind in OPTIONS])
    assert images[0] == images[1]


def test_platforms_are_chosen_by_either_name(synthetic: SyntheticFiles, tmp_path: Path) -> None:
    for fmi, expected in (("2", "linux64"), ("3", "x86_64-linux")):
        for name in ("linux64", "x86_64-linux"):
            options = ExportOptions(fmi_version=fmi, platforms=[name])
            export_estimator(synthetic.map_1, tmp_path / "a.fmu", options)
            with zipfile.ZipFile(tmp_path / "a.fmu") as archive:
                found = {entry.split("/")[1] for entry in archive.namelist() if entry.startswith("binaries/")}
            assert found == {expected}


@pytest.mark.parametrize("fmi", ["2", "3"])
def test_each_processor_of_apple_has_its_library_once(fmi: str, synthetic: SyntheticFiles, tmp_path: Path) -> None:
    """FMI 2.0: a universal library where importers look. FMI 3.0: one per processor. By name all that is named."""
    whole = library_file("darwin64").read_bytes()
    kinds = {"x86_64": 0x01000007, "aarch64": 0x0100000C}
    parts = {name: processor_library(whole, kind) for name, kind in kinds.items()}
    assert parts["aarch64"] == library_file("aarch64-darwin").read_bytes()
    assert parts["x86_64"].startswith(struct.pack("<2I", 0xFEEDFACF, kinds["x86_64"]))
    named = {"2": ["darwin64", "aarch64-darwin"], "3": ["x86_64-darwin", "aarch64-darwin"]}[fmi]
    for platforms, folders in ((None, named[: int(fmi) - 1]), (named, named)):
        options = ExportOptions(fmi_version=fmi, platforms=platforms, model_name="A")
        export_estimator(synthetic.map_1, tmp_path / "a.fmu", options)
        with zipfile.ZipFile(tmp_path / "a.fmu") as archive:
            found = {name.split("/")[1]: archive.read(name) for name in archive.namelist() if "darwin" in name}
        assert sorted(found) == sorted(folders)
        assert found.get("aarch64-darwin", parts["aarch64"]) == parts["aarch64"]
        assert found[named[0]] == (parts["x86_64"] if platforms is None and fmi == "3" else whole)


@pytest.mark.fast
@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"kind": "java"}, "kind: 'java' found, must be one of native, python, c"),
        ({"fmi_version": "1"}, "fmi: '1' found, must be one of 2, 3"),
        ({"kind": "python", "fmi_version": "3"}, r"fmi: 3 found, FMUs of kind python are of FMI 2\.0"),
        ({"scalars": True}, "scalars: fmi 2 found, expected 3"),
        ({"kind": "python", "scalars": True}, "scalars: fmi 2 found, expected 3"),
        ({"kind": "python", "platforms": ["linux64"]}, "FMUs of kind python have the platforms of PythonFMU"),
        ({"platforms": ["linux64", "amiga"]}, "platform 'amiga': no library for it, there are .*linux64"),
        ({"model_name": ""}, "model name: '' found"),
    ],
)
def test_options_that_cannot_be_are_refused(
    synthetic: SyntheticFiles, tmp_path: Path, options: dict[str, Any], message: str
) -> None:
    with pytest.raises(InputError, match=message):
        export_estimator(synthetic.map_1, tmp_path / "a.fmu", ExportOptions(**options))
    assert not (tmp_path / "a.fmu").exists()


@pytest.mark.fast
def test_modules_carry_a_hash_and_entries_are_portable(fmus: dict[str, Path]) -> None:
    packages = []
    for path in (fmus["python"], fmus["python_2"], fmus["plant"]):
        with zipfile.ZipFile(path) as archive:
            names = archive.namelist()
            module = archive.read("resources/slavemodule.txt").decode()
        suffix = module.rsplit("_", 1)[1]
        assert f"resources/strainfmu_{suffix}/errors.py" in names
        assert not [n for n in names if n.startswith("resources/strainfmu/") or "\\" in n or n.endswith(".pyc")]
        assert {n.rsplit(".", 1)[1] for n in names if n.startswith("binaries/")} == {"so", "dll"}
        packages.append(suffix)
    assert len(set(packages)) == 3


@pytest.mark.fast
def test_imports_are_renamed_and_nothing_else() -> None:
    source = '"""strainfmu."""\nfrom strainfmu import a\n    from strainfmu.b import c\n'
    assert with_own_package(source, "p") == ('"""strainfmu."""\nfrom p import a\n    from p.b import c\n')
    assert with_own_package("from strainfmu_x import d\n", "p") == "from strainfmu_x import d\n"


HOST = """
import sys

class Blocker:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in ("strainfmu", "builder", "fmus"):
            raise ImportError(f"{name} is not installed here")

sys.meta_path.insert(0, Blocker())
from fmpy import simulate_fmu
import numpy as np
for path in sys.argv[1:]:
    values = {f"strain[{i}]": 1e-6 * i for i in range(1, N_GAUGES + 1)} if "plant" not in path else {}
    result = simulate_fmu(path, start_values=values, stop_time=0.02, output_interval=0.01, output=["C_A"])
    print(repr(float(result["C_A"][0])))
print([m for m in sys.modules if m == "strainfmu" or m.startswith(("strainfmu.", "fmus"))])
print(sys.modules["pythonfmu"].__file__)
"""


def test_the_fmus_run_where_strainfmu_is_not_installed(
    synthetic: SyntheticFiles, fmus: dict[str, Path], tmp_path: Path
) -> None:
    (tmp_path / "host.py").write_text(HOST.replace("N_GAUGES", str(N_GAUGES)))
    done = subprocess.run(
        [
            sys.executable,
            "host.py",
            *(str(fmus[name]) for name in ("python", "python_2", "plant", "native")),
        ],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=True,
        timeout=60,
    )
    lines = done.stdout.splitlines()
    for line, path in zip(lines[:2], (synthetic.map_1, synthetic.map_2), strict=True):
        inverse_map = load_inverse_map(path)
        strain = 1e-6 * np.arange(1, N_GAUGES + 1)
        estimate = Estimator(inverse_map).estimate(strain, inverse_map.nominal_dynamic_pressure)
        assert float(line) == pytest.approx(estimate.coefficients[0], rel=1e-12)
    assert float(lines[3]) == pytest.approx(float(lines[0]), rel=1e-12)
    assert lines[4] == "[]"
    # Its own PythonFMU too, from the folder the FMU was unzipped to.
    assert "resources" in lines[5]


def test_packing_leaves_the_interpreter_as_it_was(synthetic: SyntheticFiles, tmp_path: Path) -> None:
    path, modules = list(sys.path), {n for n in sys.modules if "slave" in n or n.startswith("strainfmu_")}
    export_estimator(synthetic.map_1, tmp_path / "a.fmu", OPTIONS["python"])
    assert sys.path == path
    assert {n for n in sys.modules if "_slave_" in n or n.startswith("strainfmu_")} <= modules


def test_importing_the_sources_of_fmus_has_no_side_effects() -> None:
    for name in ("fmus", "fmus.python", "fmus.python.estimator_slave", "fmus.python.plant_slave"):
        importlib.import_module(name)


@pytest.mark.fast
def test_wrong_names_and_inputs_are_refused(synthetic: SyntheticFiles, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"must end in \.fmu"):
        export_estimator(synthetic.map_1, tmp_path / "a.zip")
    (tmp_path / "folder.fmu").mkdir()
    with pytest.raises(InputError, match="is a folder"):
        export_plant(synthetic.flight_model, synthetic.trajectory, tmp_path / "folder.fmu")
    with pytest.raises(InputError, match="no such file"):
        export_estimator(tmp_path / "none.h5", tmp_path / "a.fmu")
    with pytest.raises(InputError, match=r"schema 'strainfmu\.inverse_map'"):
        export_estimator(synthetic.flight_model, tmp_path / "a.fmu")
    assert not (tmp_path / "a.fmu").exists()


def test_a_trajectory_that_leaves_the_envelope_is_refused(synthetic: SyntheticFiles, tmp_path: Path) -> None:
    rows = f"{','.join(HEADER)}\n0,5,0,0,20\n10,6,9,0,20\n20,6,13,0,20\n"
    trajectory = write_trajectory(tmp_path / "high.csv", rows)
    with pytest.raises(InputError, match=r"high\.csv: total incidence: 12\.\d+ deg found at time 1\d"):
        export_plant(synthetic.flight_model, trajectory, tmp_path / "a.fmu")


def test_a_failed_write_keeps_the_old_file(
    synthetic: SyntheticFiles, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    target = tmp_path / "a.fmu"
    target.write_bytes(b"old")

    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.replace", full)
    with pytest.raises(StrainfmuError, match=r"a\.fmu: could not be written: No space left on device"):
        export_estimator(synthetic.map_1, target)
    monkeypatch.setattr("pathlib.Path.write_bytes", full)
    with pytest.raises(StrainfmuError, match="the FMU could not be packed: No space left on device"):
        export_estimator(synthetic.map_1, target, OPTIONS["python"])
    assert target.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [target]


def test_pythonfmu_missing_is_one_line(
    synthetic: SyntheticFiles, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Blocker:
        @staticmethod
        def find_spec(name: str, *_: object) -> None:
            if name.startswith("pythonfmu"):
                raise ImportError(name)

    monkeypatch.setattr(sys, "meta_path", [Blocker, *sys.meta_path])
    with pytest.raises(StrainfmuError, match=r"PythonFMU is not installed: pip install 'strainfmu\[fmu\]'"):
        export_estimator(synthetic.map_1, tmp_path / "a.fmu", OPTIONS["python"])
    export_estimator(synthetic.map_1, tmp_path / "a.fmu")  # the native kind does without
