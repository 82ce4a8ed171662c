"""The flight of a demonstration: its files and pictures, its manoeuvre against what the map covers, and the flight
of a vehicle that is no body of revolution.

Such a vehicle that flies is computed, not an FMU: flow on the finer surface along the manoeuvre, another mesh of
the structure, hardware errors drawn. Its strains go into the estimator FMU step by step."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from hashlib import sha256
from math import degrees
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

from builder.campaign.snapshots import Snapshots, load_snapshots
from builder.figures import demonstration as figures
from builder.figures.drawing import save
from builder.figures.picture_files import write_picture
from builder.figures.scene import scene_of_snapshot, shape_with_gauges
from builder.pipeline.built_sensors import flown_sensors
from builder.pipeline.map_files import make_independent_flows
from builder.pipeline.pipeline import FLOWS, MAP, SNAPSHOTS, STRUCTURE, Pipeline
from builder.structure.as_built.as_built_structure import AsBuiltStructure
from builder.structure.as_built.as_built_vehicle import AsBuilt
from builder.structure.as_built_kinds import IN_NOISE
from builder.structure.structure_file import load_structure
from builder.trial.readings import ANGLES
from builder.trial.score import ROLLING
from builder.truth.flow_table import load_flow_table, truth_knots
from builder.truth.shape import flights_along, flows_along, flying_structure
from builder.truth.true_structure import TrueStructure, flight_model
from builder.vehicle.file import Vehicle
from builder.vehicle.map_needs import is_in_radians
from strainfmu.cosim.estimators.fmu_step import FmuStep
from strainfmu.cosim.models import flight_model as flight_model_file
from strainfmu.cosim.models.flight_model import check_envelope, save_flight_model
from strainfmu.cosim.models.trajectory import Trajectory, load_trajectory
from strainfmu.cosim.systems.recording import Recording, load_recording, save_csv, save_hdf5
from strainfmu.errors import FaultsError
from strainfmu.estimator.air_inputs import ALTITUDE, DYNAMIC_PRESSURE, MACH_NUMBER, Q_SOURCE, QSource
from strainfmu.estimator.map.inverse_map import COEFFICIENT_NAMES, InverseMap, load_inverse_map
from strainfmu.files import write_bytes_atomically
from strainfmu.flight_condition import FlightCondition
from strainfmu.fmu.export import ExportOptions, export_estimator
from strainfmu.fmu.native.package import shipped_libraries
from strainfmu.interface.fmi_variables import strain_names
from strainfmu.interface.health_names import CHI_SQUARE, CHI_SQUARE_LIMIT, STATE
from strainfmu.interface.parameter_variables import PREFIX

STEP_SIZE = 0.01
"""Time between communication points, and samples, of the flight [s]: 100 Hz."""

ESTIMATOR, PLANT, FLIGHT_MODEL, FLIGHT = "estimator.fmu", "plant.fmu", "flight_model.h5", "flight.h5"


def digest_of(library: str) -> str:
    """Return what identifies the compiled code of ``library`` on all platforms."""
    libraries = shipped_libraries(library)
    return sha256(b"".join(content for _, (_, content) in sorted(libraries.items()))).hexdigest()


def make_estimator(pipeline: Pipeline, map_name: str = MAP, takes_zeros: bool = False) -> None:
    """Package the map ``map_name``, with inputs for zero offsets where a ground test gives some."""
    inputs = {"map": pipeline.made_from(map_name), "kind": "native", "library": digest_of("estimator")}
    pipeline.make(
        ESTIMATOR,
        "FMI 2.0 co-simulation FMU, native: strains in, coefficients out",
        inputs | ({"zero_inputs": True} if takes_zeros else {}),
        lambda path: export_estimator(pipeline.path(map_name), path, ExportOptions(zero_inputs=takes_zeros)),
    )


def make_flight_model(
    pipeline: Pipeline,
    inputs: dict[str, Any],
    solved: Callable[[], TrueStructure | AsBuiltStructure],
    as_built: AsBuilt,
    seed: list[int] | None = None,
) -> None:
    """Make the flight model of a vehicle ``as_built``, of the structure that is ``solved``; ``seed`` draws the
    errors of its auxiliary sensors."""
    make_independent_flows(pipeline)

    def write(path: Path) -> None:
        vehicle, structure = pipeline.vehicle, solved()
        flown = flown_sensors(vehicle, structure.surface)
        sensors = (
            None
            if flown is None
            else flown.as_built(as_built, None if seed is None else np.random.default_rng(seed))
        )
        flows = load_flow_table(pipeline.path(FLOWS), vehicle)
        noise = load_inverse_map(pipeline.path(MAP)).noise_std
        save_flight_model(flight_model(vehicle, flows, structure, as_built, float(noise[0]), sensors), path)

    made_from = {"map": pipeline.made_from(MAP), "flows": pipeline.made_from(FLOWS)}
    inputs = {"schema_version": flight_model_file.SCHEMA_VERSION, **made_from, **inputs}
    pipeline.make(FLIGHT_MODEL, "the vehicle that flies: the independent model, as built", inputs, write)


def make_flight(pipeline: Pipeline, holds: str, inputs: dict[str, Any], fly: Callable[[], Recording]) -> Recording:
    """Make the recording of a flight as HDF5 and CSV, and return it."""
    pipeline.make(FLIGHT, holds, inputs, lambda path: save_hdf5(fly(), path))
    recording = load_recording(pipeline.path(FLIGHT))
    pipeline.make("flight.csv", "the same as CSV", pipeline.inputs(FLIGHT), lambda path: save_csv(recording, path))
    return recording


def make_numbers(
    pipeline: Pipeline, name: str, holds: str, inputs: dict[str, Any], numbers: Callable[[], dict[str, Any]]
) -> dict[str, Any]:
    """Make a file of ``numbers`` (JSON), and return them."""

    def write(path: Path) -> None:
        write_bytes_atomically(path, json.dumps(numbers(), indent=1, allow_nan=False).encode())

    pipeline.make(name, holds, inputs, write)
    made: dict[str, Any] = json.loads(pipeline.path(name).read_text(encoding="utf-8"))
    return made


def make_figure(
    pipeline: Pipeline, name: str, holds: str, inputs: dict[str, Any], draw: Callable[[], figures.Figure]
) -> None:
    """Make the figure that ``draw`` returns."""
    pipeline.make(name, f"figure: {holds}", inputs, lambda path: save(draw(), path))


def make_coefficients(pipeline: Pipeline, recording: Recording, title: str) -> None:
    """Draw estimated against true coefficients."""
    holds, inputs = "estimated against true coefficients, 3 sigma bands", pipeline.inputs(FLIGHT, title=title)
    make_figure(pipeline, "coefficients.png", holds, inputs, lambda: figures.coefficients(recording, title))


def make_pictures(pipeline: Pipeline) -> None:
    """Make vehicle.png and vehicle.glb, and shape.png of another shape than a body of revolution, from the map and
    the snapshots in the pipeline's folder."""
    title = pipeline.vehicle.name
    inputs = pipeline.inputs(SNAPSHOTS, MAP, title=title)

    def parts() -> tuple[Snapshots, InverseMap, str]:
        return load_snapshots(pipeline.path(SNAPSHOTS)), load_inverse_map(pipeline.path(MAP)), title

    def draw(path: Path) -> None:
        write_picture(scene_of_snapshot(*parts()), path)

    if not pipeline.vehicle.is_axisymmetric:
        holds = "the shape with its gauges and the pressure of one condition"
        make_figure(pipeline, "shape.png", holds, inputs, lambda: shape_with_gauges(*parts()))
    pipeline.make("vehicle.png", "figure: vehicle and gauges in three dimensions, from two sides", inputs, draw)
    pipeline.make("vehicle.glb", "the same to be turned: glTF, for browsers and Blender", inputs, draw)


ROUND_OFF = 1e-9
"""By which a manoeuvre may exceed a range, in the unit of each quantity."""


def checked_manoeuvre(vehicle: Vehicle, conditions: Sequence[FlightCondition]) -> Trajectory:
    """Return the manoeuvre, within the flight model and, in its flow parameters, the snapshots' ``conditions``.

    Health would be OUTSIDE there, as the parameters are inputs of the estimator. Mach number and incidence beyond
    the snapshots' get a warning.

    Raises
    ------
    InputError
        It leaves them: a line per parameter, with the worst value and its time.
    """
    path, faults = vehicle.manoeuvre(), list[str]()
    trajectory = load_trajectory(path, tuple(vehicle.conditions.parameters))
    for i, name in enumerate(vehicle.conditions.parameters):
        known = [c.parameters[i] for c in conditions]
        flown = [FlightCondition.of_row(row).parameters[i] for row in trajectory.conditions.tolist()]
        excess = [max(min(known) - value, value - max(known)) for value in flown]
        worst = max(range(len(flown)), key=excess.__getitem__)
        if excess[worst] > ROUND_OFF:
            faults.append(
                f"{path}: {name}: expected {min(known):g} .. {max(known):g}, the range of the snapshots, got "
                f"{flown[worst]:g} at {trajectory.time[worst]:g} s"
            )
    if faults:
        raise FaultsError("\n".join(faults))
    if vehicle.is_axisymmetric:
        mach, incidence = truth_knots(vehicle.truth)
        check_envelope(mach, np.append(0.0, incidence), trajectory, path)
    return trajectory


def manoeuvre_warnings(
    vehicle: Vehicle, trajectory: Trajectory, conditions: Sequence[FlightCondition], of_revolution: bool
) -> list[str]:
    """Return, a line each, where a manoeuvre leaves what the map covers: there the sigmas may not hold.

    The first line is a question where its angles look like radians.

    Parameters
    ----------
    conditions : conditions of the snapshots.
    of_revolution : whether the snapshots are of a body of revolution, whose flows hold at every roll angle.
    """
    flown = [FlightCondition.of_row(row) for row in trajectory.conditions.tolist()]

    def both(measure: Callable[[FlightCondition], float]) -> tuple[list[float], list[float]]:
        return [measure(c) for c in flown], [measure(c) for c in conditions]

    ranges = [("Mach number", "", *both(lambda c: c.mach_number))]
    if not (of_revolution and vehicle.map.symmetry == "full"):
        ranges.append(("angle of attack", " deg", *both(lambda c: degrees(c.angle_of_attack))))
        ranges.append(("sideslip angle", " deg", *both(lambda c: degrees(c.sideslip_angle))))
    total, known = both(lambda c: degrees(c.total_incidence))
    ranges.append(("total incidence", " deg", total, [0.0, *known]))
    heights, listed = both(lambda c: 1e-3 * c.altitude)
    covered = list(vehicle.map.valid_altitude_km) if vehicle.map.follows_pressure else listed
    ranges.append((ALTITUDE, " km", heights, covered))
    for i, name in enumerate(vehicle.conditions.parameters):
        ranges.append((name, "", [c.parameters[i] for c in flown], [c.parameters[i] for c in conditions]))
    largest = max(total), max(known)
    radians = "warning: the manoeuvre flies {:.4g} deg at most, the map covers {:.4g} deg: in radians?"
    return [radians.format(*largest)] * is_in_radians(*largest) + [
        f"warning: the manoeuvre flies {name} {min(values):.4g} to {max(values):.4g}{unit}, the map covers "
        f"{min(covered):.4g} to {max(covered):.4g}{unit}: outside, sigmas may not hold"
        for name, unit, values, covered in ranges
        if min(values) < min(covered) - ROUND_OFF or max(values) > max(covered) + ROUND_OFF
    ]


NOISE_SEED = 1
OF_ROLLING = (ROLLING, f"sigma.{ROLLING}")
"""Outputs of FMUs whose map is in form "dynamic_pressure"."""


def fly_free_shape(pipeline: Pipeline, path: Trajectory, as_built: AsBuilt) -> Recording:
    """Make the FMU and its flight along ``path``, with figures, in the pipeline's folder; return the recording."""
    vehicle = pipeline.vehicle
    make_estimator(pipeline)
    inputs = {
        "fmu": pipeline.made_from(ESTIMATOR),
        "trajectory": vehicle.manoeuvre().read_bytes().hex(),
        "resolution": vehicle.resolution.truth.model_dump(),
        "structure": pipeline.made_from(STRUCTURE),
        "as built": as_built.record(IN_NOISE),
    }
    holds = "the estimator's flight: strains, truth, estimates"
    recording = make_flight(pipeline, holds, inputs, lambda: _fly(pipeline, path, as_built))
    make_coefficients(pipeline, recording, vehicle.name)
    make_pictures(pipeline)
    return recording


def _fly(pipeline: Pipeline, path: Trajectory, as_built: AsBuilt) -> Recording:
    """Step the estimator FMU through the flight of a vehicle ``as_built``."""
    vehicle, inverse_map = pipeline.vehicle, load_inverse_map(pipeline.path(MAP))
    time = STEP_SIZE * np.arange(round(path.stop_time / STEP_SIZE) + 1, dtype=np.float64)
    flows = flows_along(vehicle, path, pipeline.reporter)
    structure = flying_structure(vehicle, load_structure(pipeline.path(STRUCTURE)), pipeline.reporter)
    flown = list(flights_along(vehicle, structure, flows, time, path))
    conditions = [condition for part in flown for condition in part.conditions]
    strain = np.concatenate([part.read(as_built) for part in flown])
    strain = strain + np.random.default_rng(NOISE_SEED).standard_normal(strain.shape) * inverse_map.noise_std
    pressure = np.concatenate([part.dynamic_pressure for part in flown])
    stated = pressure * (1.0 + as_built.dynamic_pressure.item())
    parameters = tuple(vehicle.conditions.parameters)
    flow = (Q_SOURCE, MACH_NUMBER, ALTITUDE, *(f"{PREFIX}{name}" for name in parameters))
    rows, cost, measured = [], [], float(QSource.INDEPENDENT)
    with (
        pipeline.reporter.stage("Flight: the estimator FMU") as progress,
        FmuStep(pipeline.path(ESTIMATOR), flow, (CHI_SQUARE_LIMIT, *OF_ROLLING)) as step,
    ):
        of_rolling = [name for name in OF_ROLLING if name in step.other_outputs]
        for i, condition in enumerate(conditions):
            inputs = (measured, condition.mach_number, condition.altitude, *condition.parameters)
            values = dict(zip(flow, inputs, strict=True))
            begun = perf_counter()
            result = step(strain[i], stated[i], STEP_SIZE, **{n: values[n] for n in step.other_inputs})
            cost.append(perf_counter() - begun)
            rows.append(
                [
                    *result.coefficients,
                    *result.coefficients_std,
                    result.health,
                    result.chi_square,
                    *(result.other_outputs[name] for name in (CHI_SQUARE_LIMIT, *of_rolling)),
                ]
            )
            if i % 100 == 0:
                progress(i, len(strain))
    table = np.array([condition.as_row() for condition in conditions])
    rolling, sigmas = [ROLLING] if of_rolling else [], [f"sigma.{name}" for name in COEFFICIENT_NAMES]
    plant = dict.fromkeys([*COEFFICIENT_NAMES, *rolling, *strain_names(strain.shape[1])], "1")
    plant |= {DYNAMIC_PRESSURE: "Pa", MACH_NUMBER: "1", **dict.fromkeys(ANGLES, "rad"), ALTITUDE: "m"}
    plant |= dict.fromkeys(parameters, "")
    estimator = dict.fromkeys([*COEFFICIENT_NAMES, *sigmas], "1")
    estimator |= {STATE: "", CHI_SQUARE: "1", CHI_SQUARE_LIMIT: "1", **dict.fromkeys(of_rolling, "1")}
    units = {f"plant.{name}": unit for name, unit in plant.items()}
    units |= {f"estimator.{name}": unit for name, unit in estimator.items()}
    loads = np.concatenate([part.coefficients for part in flown])[:, : len(COEFFICIENT_NAMES) + len(rolling)]
    return Recording(
        time=time,
        names=tuple(units),
        units=tuple(units.values()),
        values=np.column_stack([loads, strain, stated, table, np.array(rows)]),
        instances=("estimator",),
        step_cost=np.array(cost[1:])[:, None],
    )
