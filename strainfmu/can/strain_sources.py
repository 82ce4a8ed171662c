"""Sources of strains for a virtual sender: a plant FMU, a flown scenario or recorded strains, sample by sample."""

import tempfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field, replace
from math import nan
from pathlib import Path
from typing import Any

import numpy as np

from strainfmu.arrays import FloatArray
from strainfmu.can.frame_layout import FLOW_QUANTITIES, NAVIGATION, is_reading
from strainfmu.errors import InputError
from strainfmu.estimator.air_inputs import DYNAMIC_PRESSURE
from strainfmu.estimator.map.inverse_map import COEFFICIENT_NAMES
from strainfmu.interface.fmi_variables import strain_names


@dataclass(frozen=True, eq=False)
class FlownSample:
    """Readings of the gauges, with the truth where it is known.

    Attributes
    ----------
    strain : (n_d,) [m/m].
    dynamic_pressure : q_inf [Pa].
    truth : (5,) true coefficients C_A, C_N, C_Y, M_P, M_Y [1], NaN where they are not known.
    mach_number, altitude : by navigation [1] and [m], NaN where they are not known.
    readings : of auxiliary sensors [SI unit], and thrust [N], by name of the estimator's input; others are not
        known.
    """

    strain: FloatArray
    dynamic_pressure: float
    truth: FloatArray
    mach_number: float = nan
    altitude: float = nan
    readings: Mapping[str, float] = field(default_factory=dict)


@contextmanager
def plant_samples(
    path: Path, n_gauges: int, cycle_time: float, duration: float, readings: Sequence[str] = ()
) -> Iterator[Iterator[FlownSample]]:
    """Step a plant FMU from time 0 every ``cycle_time`` [s], for ``duration`` [s].

    ``readings`` are inputs of the estimator for auxiliary sensors and thrust; those that the plant has are sent.
    """
    from strainfmu.cosim.systems.instance import Instance, read_description, safe_temporary_parent, unzip

    description = read_description(path)
    variables = _plant_outputs(path, description, n_gauges, readings)
    with ExitStack() as stack:
        parent = safe_temporary_parent()
        folder = stack.enter_context(
            tempfile.TemporaryDirectory(prefix="strainfmu_", dir=parent, ignore_cleanup_errors=True)
        )
        unzip(path, Path(folder))
        instance = Instance("plant", path, description=description, folder=Path(folder))
        stack.callback(instance.close)
        instance.begin(duration + cycle_time)
        instance.end_initialization()
        yield _stepped(
            instance, variables, n_gauges=n_gauges, cycle_time=cycle_time, n_cycles=round(duration / cycle_time)
        )


def _plant_outputs(path: Path, description: Any, n_gauges: int, readings: Sequence[str]) -> list[Any]:
    """Return strains, dynamic pressure and, where there are any, navigation, ``readings`` and all true
    coefficients."""
    # Mach number and altitude of a plant may be inputs, which keep their start values here.
    variables = {v.name: v for v in description.modelVariables if v.causality == "output" or v.name in NAVIGATION}
    names = [*strain_names(n_gauges), DYNAMIC_PRESSURE]
    missing = [name for name in names if name not in variables]
    if missing:
        raise InputError(f"{path}: no output '{missing[0]}' found: not a plant of {n_gauges} gauges")
    if f"strain[{n_gauges + 1}]" in variables:
        raise InputError(f"{path}: expected a plant of {n_gauges} gauges, got output 'strain[{n_gauges + 1}]'")
    truth = [name for name in COEFFICIENT_NAMES if name in variables]
    more_names = [name for name in (*NAVIGATION, *readings) if name in variables]
    return [variables[name] for name in (*names, *more_names, *(truth if len(truth) == 5 else ()))]


def _stepped(
    instance: Any, variables: Sequence[Any], n_gauges: int, cycle_time: float, n_cycles: int
) -> Iterator[FlownSample]:
    blocks = instance.block("Get", variables, range(len(variables)))
    step = instance.stepper()
    values = np.full(len(variables), np.nan)
    column = {variable.name: index for index, variable in enumerate(variables)}
    truth = [column[name] for name in COEFFICIENT_NAMES] if COEFFICIENT_NAMES[0] in column else []
    readings = [name for name in column if is_reading(name)]
    for cycle in range(n_cycles):
        if cycle:
            begin, end = (cycle - 1) * cycle_time, cycle * cycle_time
            step(begin, end - begin)
        for block in blocks:
            block.call()
            values[block.columns] = block.buffer
        yield FlownSample(
            values[:n_gauges].copy(),
            float(values[n_gauges]),
            values[truth] if truth else np.full(5, np.nan),
            **{name: float(values[column[name]]) for name in NAVIGATION if name in column},
            readings={name: float(values[column[name]]) for name in readings},
        )


@contextmanager
def scenario_samples(path: Path, files: Path | None, cycle_time: float) -> Iterator[Iterator[FlownSample]]:
    """Fly a scenario in closed loop first, at the rate of the bus, then yield the outputs of its plant."""
    from strainfmu.cosim.flight import fly
    from strainfmu.cosim.scenario import load_scenario
    from strainfmu.cosim.systems.instance import safe_temporary_parent
    from strainfmu.fmu.flight_export import export_flight

    scenario = replace(load_scenario(path, files), step_size=cycle_time)
    with tempfile.TemporaryDirectory(prefix="strainfmu_", dir=safe_temporary_parent()) as folder:
        fmus = export_flight(scenario, Path(folder))
        recording = fly(scenario, fmus, scenario.feedback[-1])
    n_gauges = sum(name.startswith("plant.strain[") for name in recording.names)
    strain = np.column_stack([recording[f"plant.{name}"] for name in strain_names(n_gauges)])
    truth = np.column_stack([recording[f"plant.{name}"] for name in COEFFICIENT_NAMES])
    pressure = recording["plant.dynamic_pressure"]
    # The short period has both for the whole flight.
    navigation = {name: float(getattr(scenario.start, name)) for name in NAVIGATION}
    readings = {
        name.removeprefix("plant."): recording[name]
        for name in recording.names
        if name.startswith("plant.") and is_reading(name.removeprefix("plant."))
    }
    yield (
        FlownSample(
            d, float(q), c, **navigation, readings={name: float(values[k]) for name, values in readings.items()}
        )
        for k, (d, q, c) in enumerate(zip(strain, pressure, truth, strict=True))
    )


@contextmanager
def recorded_samples(
    path: Path,
    gauge_names: Sequence[str],
    dynamic_pressure: float | None,
    readings: Mapping[str, str] | None = None,
) -> Iterator[Iterator[FlownSample]]:
    """Yield the rows of a file of recorded strains, one per cycle whatever their times.

    ``readings`` are the units of auxiliary sensors and of thrust by name of the estimator's input.
    """
    from strainfmu.recorded.estimators import recorded_readings
    from strainfmu.recorded.names import Wanted
    from strainfmu.recorded.samples import open_recording

    unknown = np.full(5, np.nan)
    columns = recorded_readings(readings or {})
    inputs = dict(zip(columns, readings or {}, strict=True))
    # The bus carries strains, q_inf, navigation and auxiliary sensors alone: no other column matters here.
    wanted = Wanted(
        gauge_names=tuple(gauge_names),
        fixed_pressure=dynamic_pressure,
        flow=(*FLOW_QUANTITIES, *columns),
        readings=columns,
        ignored=("*",),
    )
    with open_recording(path, wanted) as opened:
        yield (
            FlownSample(
                d,
                float(q),
                unknown,
                **{name: float(block.flow[name][row]) for name in NAVIGATION if name in block.flow},
                readings={
                    input_name: float(block.flow[name][row])
                    for name, input_name in inputs.items()
                    if name in block.flow
                },
            )
            for block in opened.blocks
            for row, (d, q) in enumerate(zip(block.strain, block.dynamic_pressure, strict=True))
        )
