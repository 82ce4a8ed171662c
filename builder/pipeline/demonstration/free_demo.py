"""The demonstration of a vehicle that is no body of revolution: from its file to its estimator FMU in flight.

The vehicle that flies is computed, not an FMU: flow on the finer surface along the manoeuvre, another mesh of the
structure, hardware errors drawn. Its strains go into the estimator FMU step by step.
"""

from __future__ import annotations

from hashlib import sha256
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

from builder.campaign.snapshots import load_snapshots
from builder.figures import demonstration as figures
from builder.figures.drawing.canvas import save
from builder.figures.scene.free_shape import shape_with_gauges
from builder.pipeline.demonstration.manoeuvre import check_parameters
from builder.pipeline.demonstration.pictures import make_pictures
from builder.pipeline.map_files import make_map
from builder.pipeline.pipeline import Pipeline
from builder.pipeline.used_files import MAP, SNAPSHOTS, STRUCTURE
from builder.structure.as_built.vehicle import AsBuilt
from builder.structure.as_built_kinds import IN_NOISE
from builder.structure.solid.case import structure_case
from builder.structure.solid.free_case import FreeCase
from builder.structure.structure_file import load_structure
from builder.trial.score import ROLLING
from builder.truth.shape.flight_path import FlownPath, flown_path, flows_along
from builder.truth.shape.structure import flying_structure
from builder.vehicle.map_needs import used_layouts
from strainfmu.cosim.estimators.fmu_step import FmuStep
from strainfmu.cosim.models.trajectory import load_trajectory
from strainfmu.cosim.systems.recording import Recording, load_recording, save_csv, save_hdf5
from strainfmu.errors import InputError
from strainfmu.estimator.air_inputs import ALTITUDE, DYNAMIC_PRESSURE, MACH_NUMBER, Q_SOURCE, QSource
from strainfmu.estimator.map.inverse_map import COEFFICIENT_NAMES, load_inverse_map
from strainfmu.fmu.export import export_estimator
from strainfmu.fmu.native.package import shipped_libraries
from strainfmu.interface.fmi_variables import strain_names
from strainfmu.interface.health_names import CHI_SQUARE, CHI_SQUARE_LIMIT, STATE
from strainfmu.interface.parameter_variables import PREFIX

STEP_SIZE = 0.01
"""Time between samples of the flight [s]: 100 Hz."""
NOISE_SEED = 1
OF_ROLLING = (ROLLING, f"sigma.{ROLLING}")
"""Outputs of FMUs whose map is in form "dynamic_pressure"."""


def check_free_demo(vehicle_case: FreeCase, shape_kind: str) -> None:
    """Refuse a vehicle that has no second mesh to fly.

    Raises
    ------
    InputError
        ``structure.checked_by`` is missing.
    """
    if shape_kind == "surface" and vehicle_case.other is None:
        raise InputError(
            "structure.checked_by: entry is missing, a second mesh plays the vehicle that flies in a demonstration"
        )


def fly_free_shape(pipeline: Pipeline, built: AsBuilt) -> Recording:
    """Make the map, the FMU and its flight, with figures, in the pipeline's folder; return the recording.

    Raises
    ------
    InputError
        An entry of the vehicle file does not fit, or a condition is outside the engine's reach.
    StrainfmuError
        A file could not be written or the FMU failed.
    """
    vehicle = pipeline.vehicle
    case = structure_case(vehicle, used_layouts(vehicle))
    assert isinstance(case, FreeCase)
    check_free_demo(case, vehicle.shape_kind)
    trajectory = vehicle.manoeuvre()
    make_map(pipeline)
    flown = load_trajectory(trajectory, tuple(vehicle.conditions.parameters))
    check_parameters(vehicle, flown, load_snapshots(pipeline.path(SNAPSHOTS)).conditions(), trajectory)
    library = b"".join(content for _, (_, content) in sorted(shipped_libraries("estimator").items()))
    pipeline.make(
        "estimator.fmu",
        "FMI 2.0 co-simulation FMU, native: strains in, coefficients out",
        {"map": pipeline.made_from(MAP), "kind": "native", "library": sha256(library).hexdigest()},
        lambda path: export_estimator(pipeline.path(MAP), path),
    )

    def make(path: Path) -> None:
        flown = _flown(pipeline, built)
        save_hdf5(_recording(pipeline, flown, built), path)

    inputs = {
        "fmu": pipeline.made_from("estimator.fmu"),
        "trajectory": trajectory.read_bytes().hex(),
        "resolution": vehicle.resolution.truth.model_dump(),
        "structure": pipeline.made_from(STRUCTURE),
        "as built": built.record(IN_NOISE),
    }
    pipeline.make("flight.h5", "the estimator's flight: strains, truth, estimates", inputs, make)
    recording = load_recording(pipeline.path("flight.h5"))
    of_flight: dict[str, Any] = {"flight": pipeline.made_from("flight.h5")}
    pipeline.make("flight.csv", "the same as CSV", of_flight, lambda path: save_csv(recording, path))
    _figures(pipeline, recording)
    return recording


def _flown(pipeline: Pipeline, built: AsBuilt) -> FlownPath:
    """Compute what the vehicle does on its manoeuvre."""
    vehicle, reporter = pipeline.vehicle, pipeline.reporter
    path = load_trajectory(vehicle.manoeuvre(), tuple(vehicle.conditions.parameters))
    time = STEP_SIZE * np.arange(round(path.stop_time / STEP_SIZE) + 1, dtype=np.float64)
    flows = flows_along(vehicle, path, reporter)
    structure = flying_structure(vehicle, load_structure(pipeline.path(STRUCTURE)), reporter)
    return flown_path(vehicle, structure, flows=flows, time=time, path=path, built=built)


def _recording(pipeline: Pipeline, flown: FlownPath, built: AsBuilt) -> Recording:
    """Step the estimator FMU through the flight."""
    inverse_map = load_inverse_map(pipeline.path(MAP))
    noise = np.random.default_rng(NOISE_SEED).standard_normal(flown.strain.shape) * inverse_map.noise_std
    strain = flown.strain + noise
    pressure = np.array([condition.dynamic_pressure for condition in flown.conditions])
    stated = pressure * (1.0 + built.dynamic_pressure.item())
    parameters = tuple(pipeline.vehicle.conditions.parameters)
    flow = (Q_SOURCE, MACH_NUMBER, ALTITUDE, *(f"{PREFIX}{name}" for name in parameters))
    rows, cost, measured = [], [], float(QSource.INDEPENDENT)
    with (
        pipeline.reporter.stage("Flight: the estimator FMU") as progress,
        FmuStep(pipeline.path("estimator.fmu"), flow, (CHI_SQUARE_LIMIT, *OF_ROLLING)) as step,
    ):
        of_rolling = [name for name in OF_ROLLING if name in step.other_outputs]
        for i, condition in enumerate(flown.conditions):
            values = dict(
                zip(
                    flow, (measured, condition.mach_number, condition.altitude, *condition.parameters), strict=True
                )
            )
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
    table = np.array([condition.as_row() for condition in flown.conditions])
    rolling = [ROLLING] if of_rolling else []
    plant = [*COEFFICIENT_NAMES, *rolling, *strain_names(strain.shape[1]), DYNAMIC_PRESSURE]
    plant += [MACH_NUMBER, "angle_of_attack", "sideslip_angle", ALTITUDE, *parameters]
    estimator = [*COEFFICIENT_NAMES, *(f"sigma.{name}" for name in COEFFICIENT_NAMES)]
    estimator += [STATE, CHI_SQUARE, CHI_SQUARE_LIMIT, *of_rolling]
    units = ["1"] * (5 + len(rolling) + strain.shape[1]) + ["Pa", "1", "rad", "rad", "m"] + [""] * len(parameters)
    units += ["1"] * 10 + ["", "1", "1"] + ["1"] * len(of_rolling)
    loads = [flown.coefficients, *([flown.rolling] if rolling else [])]
    return Recording(
        time=flown.time,
        names=(*(f"plant.{name}" for name in plant), *(f"estimator.{name}" for name in estimator)),
        units=tuple(units),
        values=np.column_stack([*loads, strain, stated, table, np.array(rows)]),
        instances=("estimator",),
        step_cost=np.array(cost[1:])[:, None],
    )


def _figures(pipeline: Pipeline, recording: Recording) -> None:
    """Draw estimated against true coefficients, and the pressed surface with its gauges."""
    title = pipeline.vehicle.name
    pipeline.make(
        "coefficients.png",
        "figure: estimated against true coefficients, 3 sigma bands",
        {"flight": pipeline.made_from("flight.h5"), "title": title},
        lambda path: save(figures.coefficients(recording, title), path),
    )
    pipeline.make(
        "shape.png",
        "figure: the shape with its gauges and the pressure of one condition",
        {"snapshots": pipeline.made_from(SNAPSHOTS), "map": pipeline.made_from(MAP), "title": title},
        lambda path: save(
            shape_with_gauges(
                load_snapshots(pipeline.path(SNAPSHOTS)), load_inverse_map(pipeline.path(MAP)), title
            ),
            path,
        ),
    )
    make_pictures(pipeline)
