"""The flight of a vehicle that is no body of revolution, in its demonstration.

The vehicle that flies is computed, not an FMU: flow on the finer surface along the manoeuvre, another mesh of the
structure, hardware errors drawn. Its strains go into the estimator FMU step by step.
"""

from __future__ import annotations

from time import perf_counter

import numpy as np

from builder.campaign.snapshots import load_snapshots
from builder.figures.drawing.canvas import save
from builder.figures.scene.free_shape import shape_with_gauges
from builder.pipeline.demonstration.common_files import (
    ESTIMATOR,
    STEP_SIZE,
    make_coefficients,
    make_estimator,
    make_flight,
    make_pictures,
)
from builder.pipeline.demonstration.manoeuvre import check_parameters
from builder.pipeline.map_files import make_map
from builder.pipeline.pipeline import Pipeline
from builder.pipeline.used_files import MAP, SNAPSHOTS, STRUCTURE
from builder.structure.as_built.vehicle import AsBuilt
from builder.structure.as_built_kinds import IN_NOISE
from builder.structure.structure_file import load_structure
from builder.trial.readings import ANGLES
from builder.trial.score import ROLLING
from builder.truth.shape.flight_path import flights_along, flows_along
from builder.truth.shape.structure import flying_structure
from strainfmu.cosim.estimators.fmu_step import FmuStep
from strainfmu.cosim.models.trajectory import Trajectory, load_trajectory
from strainfmu.cosim.systems.recording import Recording
from strainfmu.estimator.air_inputs import ALTITUDE, DYNAMIC_PRESSURE, MACH_NUMBER, Q_SOURCE, QSource
from strainfmu.estimator.map.inverse_map import COEFFICIENT_NAMES, load_inverse_map
from strainfmu.interface.fmi_variables import strain_names
from strainfmu.interface.health_names import CHI_SQUARE, CHI_SQUARE_LIMIT, STATE
from strainfmu.interface.parameter_variables import PREFIX

NOISE_SEED = 1
OF_ROLLING = (ROLLING, f"sigma.{ROLLING}")
"""Outputs of FMUs whose map is in form "dynamic_pressure"."""


def fly_free_shape(pipeline: Pipeline, built: AsBuilt) -> Recording:
    """Make the map, the FMU and its flight, with figures, in the pipeline's folder; return the recording.

    Raises
    ------
    InputError
        An entry of the vehicle file does not fit, or a condition is outside the engine's reach.
    StrainfmuError
        A file could not be written or the FMU failed.
    """
    vehicle, title = pipeline.vehicle, pipeline.vehicle.name
    trajectory = vehicle.manoeuvre()
    make_map(pipeline)
    path = load_trajectory(trajectory, tuple(vehicle.conditions.parameters))
    check_parameters(vehicle, path, load_snapshots(pipeline.path(SNAPSHOTS)).conditions(), trajectory)
    make_estimator(pipeline)
    inputs = {
        "fmu": pipeline.made_from(ESTIMATOR),
        "trajectory": trajectory.read_bytes().hex(),
        "resolution": vehicle.resolution.truth.model_dump(),
        "structure": pipeline.made_from(STRUCTURE),
        "as built": built.record(IN_NOISE),
    }
    holds = "the estimator's flight: strains, truth, estimates"
    recording = make_flight(pipeline, holds, inputs, lambda: _fly(pipeline, path, built))
    make_coefficients(pipeline, recording, title)
    pipeline.make(
        "shape.png",
        "figure: the shape with its gauges and the pressure of one condition",
        {"snapshots": pipeline.made_from(SNAPSHOTS), "map": pipeline.made_from(MAP), "title": title},
        lambda file: save(
            shape_with_gauges(
                load_snapshots(pipeline.path(SNAPSHOTS)), load_inverse_map(pipeline.path(MAP)), title
            ),
            file,
        ),
    )
    make_pictures(pipeline)
    return recording


def _fly(pipeline: Pipeline, path: Trajectory, built: AsBuilt) -> Recording:
    """Step the estimator FMU through the flight of a vehicle as ``built``."""
    vehicle, inverse_map = pipeline.vehicle, load_inverse_map(pipeline.path(MAP))
    time = STEP_SIZE * np.arange(round(path.stop_time / STEP_SIZE) + 1, dtype=np.float64)
    flows = flows_along(vehicle, path, pipeline.reporter)
    structure = flying_structure(vehicle, load_structure(pipeline.path(STRUCTURE)), pipeline.reporter)
    flown = list(flights_along(vehicle, structure, flows, time, path))
    conditions = [condition for part in flown for condition in part.conditions]
    strain = np.concatenate([part.read(built) for part in flown])
    strain = strain + np.random.default_rng(NOISE_SEED).standard_normal(strain.shape) * inverse_map.noise_std
    pressure = np.concatenate([part.dynamic_pressure for part in flown])
    stated = pressure * (1.0 + built.dynamic_pressure.item())
    parameters = tuple(vehicle.conditions.parameters)
    flow = (Q_SOURCE, MACH_NUMBER, ALTITUDE, *(f"{PREFIX}{name}" for name in parameters))
    rows, cost, measured = [], [], float(QSource.INDEPENDENT)
    with (
        pipeline.reporter.stage("Flight: the estimator FMU") as progress,
        FmuStep(pipeline.path(ESTIMATOR), flow, (CHI_SQUARE_LIMIT, *OF_ROLLING)) as step,
    ):
        of_rolling = [name for name in OF_ROLLING if name in step.other_outputs]
        for i, condition in enumerate(conditions):
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
    table = np.array([condition.as_row() for condition in conditions])
    rolling = [ROLLING] if of_rolling else []
    plant = [*COEFFICIENT_NAMES, *rolling, *strain_names(strain.shape[1]), DYNAMIC_PRESSURE]
    plant += [MACH_NUMBER, *ANGLES, ALTITUDE, *parameters]
    estimator = [*COEFFICIENT_NAMES, *(f"sigma.{name}" for name in COEFFICIENT_NAMES)]
    estimator += [STATE, CHI_SQUARE, CHI_SQUARE_LIMIT, *of_rolling]
    units = ["1"] * (5 + len(rolling) + strain.shape[1]) + ["Pa", "1", "rad", "rad", "m"] + [""] * len(parameters)
    units += ["1"] * 10 + ["", "1", "1"] + ["1"] * len(of_rolling)
    loads = [np.concatenate([part.coefficients for part in flown])]
    loads += [np.concatenate([part.rolling for part in flown if part.rolling is not None])] if rolling else []
    return Recording(
        time=time,
        names=(*(f"plant.{name}" for name in plant), *(f"estimator.{name}" for name in estimator)),
        units=tuple(units),
        values=np.column_stack([*loads, strain, stated, table, np.array(rows)]),
        instances=("estimator",),
        step_cost=np.array(cost[1:])[:, None],
    )
