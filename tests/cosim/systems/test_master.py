"""The co-simulation master against results computed by hand, and every line of refusal."""

import re
import sys
import tempfile
import zipfile
from pathlib import Path

import numpy as np
import pytest
from synthetic_vehicle import N_GAUGES, SyntheticFiles, synthetic_flight_model, write_trajectory

import strainfmu.fmu.export
from strainfmu.cosim.estimators.fmu_step import FmuStep
from strainfmu.cosim.models.flight_model import evaluate, load_flight_model, save_flight_model
from strainfmu.cosim.models.trajectory import HEADER, load_trajectory
from strainfmu.cosim.systems.instance import read_description, safe_temporary_parent, unzip
from strainfmu.cosim.systems.master import communication_points, matching_connections, simulate
from strainfmu.cosim.systems.recording import Recording, load_recording, save_csv, save_hdf5
from strainfmu.cosim.systems.system import Connection, System
from strainfmu.errors import InputError, StrainfmuError
from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.health import HealthState
from strainfmu.estimator.map.inverse_map import load_inverse_map
from strainfmu.fmu.checks.contents import read_fmu
from strainfmu.interface.estimator_variables import COEFFICIENTS, LOADS

pytestmark = pytest.mark.fast


def chain(synthetic: SyntheticFiles, **start_values: float) -> System:
    """Return plant -> estimator, with start values of the plant."""
    instances = {"estimator": synthetic.estimator_1, "plant": synthetic.plant}
    return System(
        instances,
        matching_connections("plant", "estimator", instances),
        {f"plant.{name}": value for name, value in start_values.items()},
    )


def test_the_chain_has_no_delay_and_is_right_from_the_start(synthetic: SyntheticFiles) -> None:
    recording = simulate(chain(synthetic, noise_std=0.0), 0.4, 0.01)
    estimator = Estimator(load_inverse_map(synthetic.map_1))
    model, trajectory = load_flight_model(synthetic.flight_model), load_trajectory(synthetic.trajectory)
    assert recording.instances == ("plant", "estimator")
    assert len(recording.time) == 41
    for row, time in enumerate(recording.time):
        point = evaluate(model, trajectory.condition_at(time))
        estimate = estimator.estimate(point.strain, point.dynamic_pressure)
        for k, (coefficient, load) in enumerate(zip(COEFFICIENTS, LOADS, strict=True)):
            assert recording[f"plant.{coefficient}"][row] == pytest.approx(point.coefficients[k], rel=1e-12)
            assert recording[f"estimator.{coefficient}"][row] == pytest.approx(estimate.coefficients[k], rel=1e-12)
            assert recording[f"estimator.{load}"][row] == pytest.approx(estimate.loads[k], rel=1e-12)
        assert recording["estimator.health.state"][row] == estimate.health


def test_only_what_is_asked_for_is_recorded(synthetic: SyntheticFiles) -> None:
    seen: list[float] = []
    recording = simulate(
        chain(synthetic), 0.025, 0.01, ["estimator.C_N", "plant.altitude", "plant.seed"], seen.append
    )
    assert recording.names == ("estimator.C_N", "plant.altitude", "plant.seed")
    assert recording.units == ("1", "m", "")
    assert recording["plant.altitude"][0] == pytest.approx(20e3)
    np.testing.assert_array_equal(recording["plant.seed"], 1.0)
    np.testing.assert_allclose(recording.time, [0.0, 0.01, 0.02, 0.025])
    assert seen == recording.time[1:].tolist()
    assert recording.step_cost.shape == (3, 2)
    assert np.all(recording.step_cost > 0.0)


def test_an_integer_start_value_reaches_the_fmu(synthetic: SyntheticFiles) -> None:
    strains = [simulate(chain(synthetic, seed=s), 0.01, 0.01)["plant.strain[1]"] for s in (1, 1, 2)]
    np.testing.assert_array_equal(strains[0], strains[1])
    assert np.all(strains[0] != strains[2])


def test_nothing_is_left_behind(
    synthetic: SyntheticFiles, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    path, modules = list(sys.path), set(sys.modules)
    simulate(chain(synthetic), 0.01, 0.01)
    with pytest.raises(InputError, match="no variable"):
        simulate(chain(synthetic), 0.01, 0.01, ["plant.nothing"])
    assert list(tmp_path.iterdir()) == []
    assert sys.path == path
    assert not [name for name in set(sys.modules) - modules if name.startswith(("strainfmu_", "plant_slave"))]


def test_communication_points_end_exactly_at_stop_time() -> None:
    np.testing.assert_array_equal(communication_points(0.3, 0.1), [0.0, 0.1, 0.2, 0.3])
    np.testing.assert_array_equal(communication_points(0.25, 0.1), [0.0, 0.1, 0.2, 0.25])


@pytest.mark.parametrize(
    ("stop", "step", "words"),
    [
        (0.0, 0.1, "stop_time: expected a positive time, got 0 s"),
        (1.0, -1.0, "communication_step_size: expected a positive time, got -1 s"),
        (float("inf"), 0.1, "stop_time: expected a positive time, got inf s"),
        (1.0, 2.0, "at most stop_time, 1 s, allowed"),
    ],
)
def test_wrong_times_are_refused(stop: float, step: float, words: str) -> None:
    with pytest.raises(InputError, match=words):
        communication_points(stop, step)


@pytest.mark.parametrize(
    ("connection", "words"),
    [
        (("plane.C_A", "a.strain[1]"), "no instance 'plane', there are plant, a, b"),
        (("C_A", "a.strain[1]"), "no instance 'C_A'"),
        (("plant.lift", "a.strain[1]"), "the FMU of 'plant' has no variable 'lift'"),
        (("plant.strain[1]", "a.strain[99]"), r"no variable 'strain\[99\]'"),
        (("plant.noise_std", "a.strain[1]"), "causality parameter, not output"),
        (("plant.strain[1]", "a.C_A"), "causality output, not input"),
        (("plant.altitude", "a.dynamic_pressure"), "unit 'm' cannot feed unit 'Pa'"),
        (("a.health.state", "b.strain[1]"), "Enumeration cannot feed Real"),
        (("a.C_A", "a.strain[1]"), "cycle: a -> a"),
    ],
)
def test_wrong_connections_are_refused(synthetic: SyntheticFiles, connection: tuple[str, str], words: str) -> None:
    instances = {"plant": synthetic.plant, "a": synthetic.estimator_1, "b": synthetic.estimator_2}
    with pytest.raises(InputError, match=words) as error:
        simulate(System(instances, [Connection(*connection)]), 1.0, 0.1)
    assert "\n" not in str(error.value)


def test_cycles_and_double_feeds_are_refused(synthetic: SyntheticFiles) -> None:
    instances = {"a": synthetic.estimator_1, "b": synthetic.estimator_2}
    cycle = [Connection("a.C_A", "b.strain[1]"), Connection("b.C_A", "a.strain[1]")]
    with pytest.raises(InputError, match=r"connections form a cycle: [ab] -> [ab] -> [ab]"):
        simulate(System(instances, cycle), 1.0, 0.1)
    double = [Connection("a.C_A", "b.strain[1]"), Connection("a.C_N", "b.strain[1]")]
    with pytest.raises(InputError, match=r"a\.C_A feeds that input already"):
        simulate(System(instances, double), 1.0, 0.1)
    with pytest.raises(InputError, match="no output of 'a' has the name of an input of 'b'"):
        matching_connections("a", "b", instances)


def test_navigation_goes_from_the_plant_to_the_estimator(synthetic: SyntheticFiles) -> None:
    """What matches by name carries it: the estimator sees q_inf, Mach number and altitude of one atmosphere."""
    targets = {connection.target for connection in chain(synthetic).connections}
    assert {"estimator.dynamic_pressure", "estimator.mach_number", "estimator.altitude"} <= targets
    assert "estimator.dynamic_pressure_std" not in targets
    recording = simulate(chain(synthetic, noise_std=0.0), 0.4, 0.1, record=["estimator.health.state"])
    assert HealthState.OUTSIDE not in recording["estimator.health.state"]


@pytest.mark.parametrize(
    ("start_values", "words"),
    [({"plant.C_A": 1.0}, "causality output, not input or parameter"), ({"plant.x": 1.0}, "no variable 'x'")],
)
def test_wrong_start_values_are_refused(
    synthetic: SyntheticFiles, start_values: dict[str, float], words: str
) -> None:
    with pytest.raises(InputError, match=words):
        simulate(System({"plant": synthetic.plant}, start_values=start_values), 1.0, 0.1)


def test_wrong_instances_are_refused(synthetic: SyntheticFiles) -> None:
    with pytest.raises(InputError, match="expected at least one instance, got none"):
        simulate(System({}), 1.0, 0.1)
    with pytest.raises(InputError, match=r"instance 'a\.b': a dot found"):
        simulate(System({"a.b": synthetic.plant}), 1.0, 0.1)


def repacked(source: Path, target: Path, **changes: bytes) -> Path:
    """Write a copy of an FMU in which the entries that end in a key (_ for .) have other content."""
    with zipfile.ZipFile(source) as old, zipfile.ZipFile(target, "w") as new:
        for name in old.namelist():
            other = next((c for key, c in changes.items() if name.endswith(key.replace("_", "."))), None)
            new.writestr(name, old.read(name) if other is None else other)
    return target


def test_missing_and_damaged_fmus_are_refused(synthetic: SyntheticFiles, tmp_path: Path) -> None:
    def message(path: Path) -> str:
        with pytest.raises(StrainfmuError) as error:
            simulate(System({"x": path}), 1.0, 0.1)
        assert "\n" not in str(error.value)
        assert path.name in str(error.value)
        assert "strainfmu_" not in str(error.value)  # the folder it is unzipped into
        return str(error.value)

    assert "no such FMU" in message(tmp_path / "none.fmu")
    (tmp_path / "text.fmu").write_text("no zip")
    assert "damaged, or not an FMU" in message(tmp_path / "text.fmu")
    whole = bytearray(synthetic.plant.read_bytes())
    whole[5000:6000] = bytes(1000)
    (tmp_path / "holes.fmu").write_bytes(whole)
    assert "damaged" in message(tmp_path / "holes.fmu")
    xml = zipfile.ZipFile(synthetic.plant).read("modelDescription.xml")
    exchange = xml.replace(b"<CoSimulation", b"<ModelExchange")
    assert "expected an FMU for FMI 2.0 co-simulation" in message(
        repacked(synthetic.plant, tmp_path / "me.fmu", modelDescription_xml=exchange)
    )
    assert "cannot be loaded on this machine" in message(
        repacked(synthetic.plant, tmp_path / "binary.fmu", _so=b"none", _dll=b"none")
    )
    assert "instance 'x' cannot be instantiated: " in message(
        repacked(synthetic.plant, tmp_path / "data.fmu", h5=b"none")
    )


def test_an_fmu_that_unpacks_to_gigabytes_is_not_unpacked(synthetic: SyntheticFiles, tmp_path: Path) -> None:
    """An entry that states 3 GB, wherever an FMU is read; what is in it does not matter."""
    path = tmp_path / "large.fmu"
    path.write_bytes(synthetic.estimator_1.read_bytes())
    with zipfile.ZipFile(path, "a") as archive:
        archive.writestr("resources/large.bin", b"x")
    content = bytearray(path.read_bytes())
    size = content.rindex(b"PK\x01\x02", 0, content.rindex(b"resources/large.bin")) + 24  # in the directory
    content[size : size + 4] = (3_000_000_000).to_bytes(4, "little")
    path.write_bytes(content)
    line = re.escape(f"{path}: expected at most 1.0 GB in the archive, got 3.0 GB")
    for read in (FmuStep, read_fmu, read_description, lambda fmu: unzip(fmu, tmp_path / "x")):
        with pytest.raises(InputError, match=line):
            read(path)
    assert not (tmp_path / "x").exists()


def test_an_fmu_that_fails_says_why(
    synthetic: SyntheticFiles, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(strainfmu.fmu.export, "check_envelope", lambda *_, **__: None)
    rows = f"{','.join(HEADER)}\n0,5,0,0,20\n1,9,0,0,20\n"
    trajectory = write_trajectory(tmp_path / "t.csv", rows)
    strainfmu.fmu.export.export_plant(synthetic.flight_model, trajectory, tmp_path / "fast.fmu")
    with pytest.raises(StrainfmuError) as error:
        simulate(System({"fast": tmp_path / "fast.fmu"}), 1.0, 0.1)
    assert "instance 'fast': fmi2DoStep returned fmi2Discard at time 0.5 s: mach_number: 7.4 found" in str(
        error.value
    )
    assert "\n" not in str(error.value)


def test_unzip_folders_are_chosen_with_care(tmp_path: Path) -> None:
    bad = tmp_path / "mü (1)"
    bad.mkdir()
    good = tmp_path / "plain folder"
    good.mkdir()
    assert safe_temporary_parent([bad, good]) == good.resolve()
    with pytest.raises(StrainfmuError, match="set TMPDIR"):
        safe_temporary_parent([bad])


def test_fmpy_missing_is_one_line(synthetic: SyntheticFiles, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "fmpy", None)
    with pytest.raises(StrainfmuError, match=r"pip install 'strainfmu\[fmu\]'"):
        simulate(System({"plant": synthetic.plant}), 1.0, 0.1)


def test_a_recording_survives_the_disk(synthetic: SyntheticFiles, tmp_path: Path) -> None:
    recording = simulate(chain(synthetic), 0.02, 0.01)
    save_hdf5(recording, tmp_path / "r.h5")
    loaded = load_recording(tmp_path / "r.h5")
    assert (loaded.names, loaded.units, loaded.instances) == (
        recording.names,
        recording.units,
        recording.instances,
    )
    for name in ("time", "values", "step_cost"):
        np.testing.assert_array_equal(getattr(loaded, name), getattr(recording, name))
    save_csv(recording, tmp_path / "r.csv")
    lines = (tmp_path / "r.csv").read_text().splitlines()
    assert lines[0].startswith('"time","plant.C_A","plant.C_N"')
    table = np.loadtxt(tmp_path / "r.csv", delimiter=",", skiprows=1)
    np.testing.assert_array_equal(table[:, 1:], recording.values)
    with pytest.raises(InputError, match="no signal 'x'"):
        recording["x"]


def test_names_with_a_slash_survive_the_disk(tmp_path: Path) -> None:
    save_hdf5(
        Recording(time=np.zeros(1), names=("x.'a/b'", "x.c"), units=("m", ""), values=np.ones((1, 2))),
        tmp_path / "r.h5",
    )
    loaded = load_recording(tmp_path / "r.h5")
    assert (loaded.names, loaded.units) == (("x.'a/b'", "x.c"), ("m", ""))


def test_recordings_are_refused_or_kept_whole(tmp_path: Path) -> None:
    recording = Recording(time=np.zeros(1), names=("a.b",), units=("",), values=np.zeros((1, 1)))
    (tmp_path / "file").write_text("")
    with pytest.raises(StrainfmuError, match="could not be written"):
        save_csv(recording, tmp_path / "file" / "r.csv")
    save_flight_model(synthetic_flight_model(), tmp_path / "other.h5")
    with pytest.raises(InputError, match=r"schema 'strainfmu\.recording'"):
        load_recording(tmp_path / "other.h5")


def test_two_estimators_of_different_maps_keep_their_own_results(synthetic: SyntheticFiles) -> None:
    strain = np.linspace(-1e-6, 1e-6, N_GAUGES)
    system = System(
        {"a": synthetic.estimator_1, "b": synthetic.estimator_2, "c": synthetic.estimator_1},
        start_values={f"{name}.strain[{i + 1}]": s for name in "abc" for i, s in enumerate(strain)},
    )
    recording = simulate(system, 0.2, 0.1)
    for name, path in (("a", synthetic.map_1), ("b", synthetic.map_2), ("c", synthetic.map_1)):
        inverse_map = load_inverse_map(path)
        expected = Estimator(inverse_map).estimate(strain, inverse_map.nominal_dynamic_pressure).coefficients
        for k, coefficient in enumerate(COEFFICIENTS):
            np.testing.assert_allclose(recording[f"{name}.{coefficient}"], expected[k], rtol=1e-12)
