"""Hinge moments of an elliptic cone's flaps: flights between the snapshots, and the same numbers by every way."""

from ctypes import c_double
from functools import cache
from pathlib import Path
from typing import Any

import cantools
import numpy as np
import pytest
from can_case import CYCLE, bus_options
from composed_frames import ResultFrames
from raw_fmu import OK, Fmu2, Fmu3, write_resource
from recorded_case import read_csv, write_csv
from shape_case import flown, grid_conditions, shape_map, shape_structure, shape_vehicle

from builder.aero.load_groups import bending_operator, hinge_operator
from builder.vehicle.map_options import BendingMoment, HingeMoment, Region
from strainfmu.can.machine import Result
from strainfmu.can.profiles import Identifiers
from strainfmu.can.quality import Quality
from strainfmu.can.result_frames import result_layouts
from strainfmu.can.setup import write_dbc
from strainfmu.cosim.estimators.source import open_step
from strainfmu.cosim.estimators.step import load_groups_of
from strainfmu.errors import InputError
from strainfmu.estimator.estimate import Estimate
from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.map.inverse_map import InverseMap, load_inverse_map, save_inverse_map
from strainfmu.fmu.export import ExportOptions, export_estimator
from strainfmu.interface.estimator_variables import estimator_arrays, estimator_interface
from strainfmu.recorded.run import estimate_file

REGIONS = {
    "starboard": Region(from_m=(1.0, 0.1, -1.0), to_m=(3.0, 1.0, 0.0)),
    "port": Region(from_m=(1.0, -1.0, -1.0), to_m=(3.0, -0.1, 0.0)),
}
HINGES = [
    HingeMoment(name=f"{region} flap", region=region, point_m=(1.0, 0.0, -0.1), direction=(0.0, 3.0, 0.0))
    for region in REGIONS
]
BENDING = [BendingMoment(name="joint", station_m=1.2, roll_angle_deg=30.0)]
NAMES = [f"moment.hinge[{i}]" for i in (1, 2)]
COLUMNS = [f"{name}[{i}]" for name in ("hinge_moment", "sigma.hinge_moment", "M_H", "sigma.M_H") for i in (1, 2)]


@cache
def held(estimator: str = "linear") -> InverseMap:
    found = shape_map(estimator=estimator, regions=REGIONS, hinge_moments=HINGES, bending_moments=BENDING)
    return found if estimator == "nonlinear" else found.without_tables()


@cache
def flights() -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return strain, q_inf, Mach number, hinge and bending moments of flights between the snapshots."""
    snapshots = flown(grid_conditions(mach=(6.2, 6.8), alpha=(-3.0, 1.0, 2.5), beta=(-1.5, 0.4)))
    net = snapshots.pressure - snapshots.internal_pressure[:, None]
    strain = net @ shape_structure(snapshots.surface).strain_operator("four_rows").T
    strain = strain + held().noise_std * np.random.default_rng(3).standard_normal(strain.shape)
    conditions = snapshots.conditions()
    q, mach = (
        np.array([getattr(one, name) for one in conditions]) for name in ("dynamic_pressure", "mach_number")
    )
    entry = shape_vehicle(regions=REGIONS, hinge_moments=HINGES, bending_moments=BENDING).map
    true = np.vstack([hinge_operator(snapshots.surface, entry), bending_operator(snapshots.surface, entry)])
    return strain, q, mach, net @ true.T


def estimated(estimator: str = "linear", sample: Any = slice(None)) -> Estimate:
    strain, q, mach, _ = flights()
    flow = {"mach_number": mach[sample]} if estimator == "nonlinear" else {}
    return Estimator(held(estimator)).estimate(strain[sample], q[sample], q_source="independent", **flow)


@pytest.mark.parametrize("estimator", ["linear", "nonlinear"])
def test_true_moments_lie_within_their_uncertainty(estimator: str) -> None:
    true, of_flights = flights()[3], estimated(estimator)
    found, bending = of_flights.group("hinge_moment"), of_flights.group("bending_moment")
    assert bending.places == ("joint",)
    assert np.all(np.abs(bending.loads - true[:, 2:]) <= 3.0 * bending.std)
    assert np.all(bending.std < 0.1 * np.ptp(true[:, 2]))
    true = true[:, :2]
    assert found.places == ("starboard flap", "port flap")
    assert np.all(np.abs(found.loads - true) <= 3.0 * found.std)
    assert np.all(found.std < 0.1 * np.ptp(true, axis=0)), "a deviation says something"
    one, is_linear = held(estimator), estimator == "linear"
    scale = flights()[1][:, None] * one.reference_area * one.reference_length
    # The nonlinear estimator divides by the dynamic pressure that it estimates.
    np.testing.assert_allclose(found.coefficients * scale, found.loads, rtol=1e-9 if is_linear else 1e-3)


def test_a_group_that_the_map_does_not_give_is_refused() -> None:
    with pytest.raises(
        InputError,
        match=r"group: expected one of rolling_moment, hinge_moment, bending_moment, got 'section.axial'",
    ):
        estimated().group("section.axial")


def test_the_map_file_holds_the_lines(tmp_path: Path) -> None:
    save_inverse_map(held(), tmp_path / "map.h5")
    lines = load_inverse_map(tmp_path / "map.h5").hinge_lines
    assert lines is not None
    assert (lines.name, lines.region) == (("starboard flap", "port flap"), ("starboard", "port"))
    np.testing.assert_array_equal(lines.direction, [[0.0, 1.0, 0.0]] * 2)
    np.testing.assert_array_equal(lines.point, [[1.0, 0.0, -0.1]] * 2)


@pytest.mark.parametrize("estimator", ["linear", "nonlinear"])
def test_python_and_fmus_of_both_versions_agree(estimator: str, tmp_path: Path) -> None:
    one, (strain, q, _, _) = held(estimator), flights()
    found = Estimator(one).estimate(strain[4], q[4]).group("hinge_moment")
    bending = Estimator(one).estimate(strain[4], q[4]).group("bending_moment")
    expected = np.concatenate(
        [found.coefficients, found.coefficients_std, found.loads, found.std, bending.loads, bending.std]
    )
    interface = estimator_interface(one)
    place = {variable.name: number for number, variable in enumerate(interface)}
    resources = write_resource(one, tmp_path)
    two = Fmu2(resources.as_uri(), one.n_gauges).start()
    two.set_strain(strain[4])
    assert two.set_reals([place["dynamic_pressure"]], [q[4]]) == OK
    outputs = [f"{of}{name}[{i}]" for name in ("M_H", "moment.hinge") for of in ("", "sigma.") for i in (1, 2)]
    outputs += ["moment.bending[1]", "sigma.moment.bending[1]"]
    of_two = two.get_reals([place[name] for name in outputs])
    np.testing.assert_allclose(of_two, expected, rtol=1e-12)
    array = {variable.name: number for number, variable in enumerate(estimator_arrays(interface))}
    three = Fmu3(str(resources), one.n_gauges).start()
    assert three.set("Float64", c_double, [array["strain"]], strain[4]) == OK
    assert three.set("Float64", c_double, [array["dynamic_pressure"]], [q[4]]) == OK
    arrays = ("M_H", "sigma.M_H", "moment.hinge", "sigma.moment.hinge")
    of_three = [three.get("Float64", c_double, [array[name]], 2)[1] for name in arrays]
    of_three += [three.get("Float64", c_double, [array[f"{s}moment.bending"]], 1)[1] for s in ("", "sigma.")]
    assert np.concatenate(of_three).tobytes() == of_two.tobytes()
    two.free()


def test_columns_of_a_recording_by_map_and_by_fmu(tmp_path: Path) -> None:
    strain, q, _, _ = flights()
    save_inverse_map(held(), tmp_path / "map.h5")
    export_estimator(tmp_path / "map.h5", tmp_path / "e.fmu", ExportOptions())
    at_once = float(q[0])
    data = write_csv(tmp_path / "d.csv", ["time", *held().gauge_names], 1e-3 * np.arange(len(strain)), strain)
    found = Estimator(held()).estimate(strain, at_once).group("hinge_moment")
    expected = np.hstack([found.loads, found.std, found.coefficients, found.coefficients_std])
    tables = []
    for source in ("map.h5", "e.fmu"):
        estimate_file(tmp_path / source, data, tmp_path / "o.csv", at_once)
        tables.append(read_csv(tmp_path / "o.csv"))
        unit = {True: "N m", False: "1"}
        named = [f"{name} [{unit['hinge' in name]}]" for name in COLUMNS]
        values = np.column_stack([tables[-1][name] for name in named])
        np.testing.assert_allclose(values, expected, rtol=1e-9)
    assert list(tables[0]) == list(tables[1])


@pytest.mark.parametrize(("profile", "form"), [("fd64", "fd"), ("classic-le", "classic-le")])
def test_frames_of_the_bus(profile: str, form: str, tmp_path: Path) -> None:
    """What map and FMU send is equal, and what cantools reads by the DBC file is what Python estimates."""
    strain, q, _, _ = flights()
    save_inverse_map(held(), tmp_path / "map.h5")
    export_estimator(tmp_path / "map.h5", tmp_path / "e.fmu", ExportOptions())
    expected, sent = estimated(sample=2).group("hinge_moment"), []
    for source in ("map.h5", "e.fmu"):
        write_dbc(tmp_path / source, tmp_path / "m.dbc", bus_options(profile))
        database = cantools.database.load_file(tmp_path / "m.dbc")
        with open_step(tmp_path / source) as ready:
            layouts = result_layouts(form, Identifiers(), CYCLE, load_groups_of(ready.step))
            step = ready.step(strain[2], q[2], CYCLE)
        valid = np.ones(len(strain[2]), dtype=bool)
        result = Result(
            time=1.0,
            quality=Quality.VALID,
            causes=0,
            valid=valid,
            strain=strain[2],
            other_outputs=step.other_outputs,
        )
        frames = ResultFrames(layouts, 1).of_result(result)
        sent.append([frame.data for frame in frames])
        values: dict[str, Any] = {}
        for frame in frames:
            values |= database.decode_message(frame.identifier, frame.data, decode_choices=False)
        moments, deviations = (
            np.array([values[f"{of}moment_hinge_{i}"] for i in (1, 2)]) for of in ("", "sigma_")
        )
        np.testing.assert_allclose(moments, expected.loads, rtol=2e-7)
        if form == "fd":
            np.testing.assert_allclose(deviations, expected.std, rtol=2e-7)
        else:
            assert np.all((deviations >= expected.std - 1e-9) & (deviations < expected.std + 0.01))
        names = {message.name: message.comment for message in database.messages}
        first = "Hinge1" if form == "fd" else "Hinge1_moment"
        assert names[first] == "Hinge moment of the air, right-handed about hinge line starboard flap"
    assert sent[0] == sent[1]
