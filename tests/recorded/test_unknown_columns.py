"""Columns with unknown names: refused with the nearest known name, left out on request, never without a word."""

from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pytest
from flight_fmu import whole_map
from other_load_maps import with_further_tables
from recorded_case import NAMES, samples, write_flight
from synthetic_vehicle import SyntheticFiles

from strainfmu.cosim.systems.instance import read_description
from strainfmu.errors import InputError
from strainfmu.interface.estimator_variables import estimator_interface
from strainfmu.recorded.names import Wanted
from strainfmu.recorded.samples import open_recording

pytestmark = pytest.mark.fast

Run = Callable[..., tuple[int, str, str]]


@pytest.mark.parametrize(
    ("name", "hint"),
    [
        ("dynamic_presure_std", "did you mean 'dynamic_pressure_std'"),
        ("dynamic_pressure_sigma", "did you mean 'dynamic_pressure_std'"),
        ("Mach", "did you mean 'mach_number'"),
        ("MACH_NUMBER", "did you mean 'mach_number'"),
        ("nav.alt [m]", "did you mean 'altitude'"),
        ("strain[7]", "expected strain[1] to strain[6]"),
        ("temperature", "expected a gauge, strain[i], time, dynamic_pressure, "),
        ("plant.valid[1]", "expected a gauge, "),
    ],
)
def test_an_unknown_column_is_refused(name: str, hint: str, tmp_path: Path) -> None:
    data = write_flight(tmp_path / "d.csv", **{name: 1.0})
    with pytest.raises(InputError) as error, open_recording(data, Wanted(gauge_names=tuple(NAMES))):
        pass
    shown = name.partition(" [")[0]
    assert str(error.value).startswith(f"{data}: column '{shown}': unknown name; {hint}")
    assert f", leave it out by --ignore-columns '{shown}', or name the gauges in" in str(error.value)
    assert str(error.value).endswith("a channel file, which 'strainfmu channels MAP DATA' proposes")


def test_a_recording_without_any_gauge_is_sent_to_the_channel_file(tmp_path: Path) -> None:
    data = tmp_path / "d.csv"
    data.write_text("time;SG01_ax [um/m];SG02_ax [um/m];q_inf [kPa]\n0;0;0;90\n")
    with (
        pytest.raises(
            InputError, match=r"no column is a gauge or strain\[i\]: .*'strainfmu channels MAP DATA'"
        ) as error,
        open_recording(data, Wanted(gauge_names=("axial_1", "axial_2"))),
    ):
        pass
    assert "--ignore-columns" not in str(error.value), "it would leave out one gauge after the other"


def test_a_gauge_misspelt_is_named(tmp_path: Path) -> None:
    data = tmp_path / "d.csv"
    data.write_text("time,axial_1,axial-2,dynamic_pressure\n0,0,0,9e4\n")
    with (
        pytest.raises(InputError, match=r"column 'axial-2': unknown name; did you mean 'axial_2'"),
        open_recording(data, Wanted(gauge_names=("axial_1", "axial_2"))),
    ):
        pass


def test_columns_are_left_out_by_name_and_named_at_the_end(
    synthetic: SyntheticFiles, tmp_path: Path, run: Run
) -> None:
    more = {"temperature_1 [K]": 300.0, "temperature_2": 301.0, "operator": 7.0, "plant.C_N": 0.1}
    data = write_flight(tmp_path / "d.csv", **more)
    out = tmp_path / "o.csv"
    code, _, errors = run("estimate", synthetic.map_1, data, "-o", out)
    assert code == 2
    assert "column 'temperature_1': unknown name, and of 2 others: temperature_2, operator; " in errors
    assert not out.exists()
    code, printed, errors = run(
        "estimate", synthetic.map_1, data, "-o", out, "--ignore-columns", "temp*, operator"
    )
    assert (code, errors) == (0, "")
    assert f"{data}: 4 columns not used: temperature_1, temperature_2, operator, plant.C_N\n" in printed
    code, _, errors = run("estimate", synthetic.map_1, data, "-o", out, "--ignore-columns", "*,pilot")
    assert code == 2
    assert "--ignore-columns: no column 'pilot' found, it holds time, G0" in errors


def test_signals_of_a_simulation_are_known(synthetic: SyntheticFiles, tmp_path: Path) -> None:
    """Every output of the estimator and of the plant, as a recording names it."""
    names = []
    for instance, fmu in (("estimator", synthetic.estimator_1), ("plant", synthetic.plant)):
        found = read_description(fmu).modelVariables
        names += [f"{instance}.{one.name}" for one in found if one.causality == "output"]
    names = [name for name in names if not name.endswith("]") and not name.endswith(".dynamic_pressure")]
    assert len(names) > 30
    data = write_flight(tmp_path / "d.csv", **dict.fromkeys(names, 1.0))
    with open_recording(data, Wanted(gauge_names=tuple(NAMES))) as opened:
        read = {f"plant.{name}" for name in opened.selection.stated}
        assert {*opened.selection.unused} | read == {*names}


def test_air_data_of_an_estimator_are_not_what_flew(tmp_path: Path) -> None:
    """Outputs of the nonlinear estimator have names of the flow; an instance ``air_data`` is read."""
    interface = estimator_interface(with_further_tables(whole_map()))
    names = [f"estimator.{one.name}" for one in interface if one.causality == "output"]
    assert {"estimator.air_data.mach_number", "estimator.sigma.air_data.dynamic_pressure"} < {*names}
    assert "estimator.section.normal[1]" in names
    flown = {"plant.mach_number": 6.0, "air_data.altitude": 2e4}
    data = write_flight(tmp_path / "d.csv", **dict.fromkeys(names, 1.0), **flown)
    with open_recording(data, Wanted(gauge_names=tuple(NAMES))) as opened:
        assert {*opened.selection.unused} == {*names}
        assert opened.selection.stated == ("mach_number", "altitude")
        (block,) = opened.blocks
        assert np.all(block.flow["mach_number"] == 6.0)


def test_a_known_column_is_left_out_by_its_name_alone(tmp_path: Path) -> None:
    data = write_flight(tmp_path / "d.csv", mach_number=6.0, altitude=2e4)
    wanted = Wanted(gauge_names=tuple(NAMES), ignored=("*", "mach_number"))
    with open_recording(data, wanted) as opened:
        assert opened.selection.stated == ("altitude",)
        assert opened.selection.unused == ("mach_number",)


def test_unknown_data_sets_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "d.h5"
    time, strain, pressure = samples(3)
    for signals in (False, True):
        with h5py.File(path, "w") as file:
            group = file.create_group("signals") if signals else file
            if signals:
                file["time"] = time
                for name, values in zip(NAMES, strain.T, strict=True):
                    group[f"rig.{name}"] = values
            else:
                group["time"], group["strain"] = time, strain
            group["dynamic_pressure"], group["mach_nr"] = pressure, np.full((3, 1), 6.0)
        names = tuple(f"rig.{name}" for name in NAMES) if signals else tuple(NAMES)
        for ignored in ((), ("mach_nr",)):
            wanted = Wanted(gauge_names=names, ignored=ignored)
            if ignored:
                with open_recording(path, wanted) as opened:
                    (block,) = opened.blocks
                assert opened.selection.unused == ("mach_nr",)
                np.testing.assert_array_equal(block.strain, strain)
                continue
            line = "column 'mach_nr': unknown name; did you mean 'mach_number'"
            with pytest.raises(InputError, match=line), open_recording(path, wanted):
                pass


def test_headings_without_a_name(tmp_path: Path) -> None:
    """Separators behind the last heading, as spreadsheets leave them, are no columns unless values stand there."""
    path, wanted = tmp_path / "d.csv", Wanted(gauge_names=("a",))
    path.write_text("time,a,dynamic_pressure,,\n0,1e-6,9e4,,\n")
    with open_recording(path, wanted) as opened:
        assert len(list(opened.blocks)) == 1
    path.write_text(",time,a,dynamic_pressure\n0,0,1e-6,9e4\n")  # the index of a data frame
    with (
        pytest.raises(InputError, match="column 1: no name found; leave it out by"),
        open_recording(path, wanted),
    ):
        pass
    path.write_text("time,a,dynamic_pressure,,\n0,1e-6,9e4,,5\n")
    with (
        pytest.raises(InputError, match="line 2: expected 3 cells, got 5"),
        open_recording(path, wanted) as opened,
    ):
        list(opened.blocks)


def test_logs_take_no_options_of_tables(synthetic: SyntheticFiles, tmp_path: Path, run: Run) -> None:
    code, _, errors = run(
        "estimate", synthetic.map_1, tmp_path / "run.blf", "-o", tmp_path / "o.csv", "--residuals"
    )
    assert code == 2
    assert "expected none with a CAN log" in errors
