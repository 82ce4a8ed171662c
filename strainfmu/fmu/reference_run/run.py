"""A short run that an importer can repeat: input, expected output, and what the FMU holds of both.

An importer of co-simulation holds inputs over a step, so what it records at the end of a step belongs to the
inputs at its start. The expected output is that: row 0 of the first input, row k of the input of row k - 1.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any
from xml.etree.ElementTree import Element, SubElement, indent, tostring

import numpy as np
from numpy.typing import NDArray

from strainfmu.estimator.estimate import Estimate
from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.health import HealthState
from strainfmu.estimator.map.inverse_map import InverseMap, groups_of_outputs
from strainfmu.estimator.map.validity import parameter_names_of
from strainfmu.estimator.policies import POLICIES
from strainfmu.estimator.signal_names import COEFFICIENT_ARRAY, FORCE, MOMENT, TEMPERATURE
from strainfmu.estimator.tare import TareState
from strainfmu.fmu.reference_run.flight_path import rounded
from strainfmu.fmu.reference_run.readings import FAULT_STATES, Fault, Readings, reference_readings
from strainfmu.interface.estimator_variables import estimator_interface, output_values
from strainfmu.interface.fmi_variables import COEFFICIENTS, Variable
from strainfmu.interface.health_names import CHI_SQUARE, STATE, SUSPECT_GAUGE
from strainfmu.interface.input_names import FLOW_INPUTS
from strainfmu.interface.parameter_variables import parameter_names, parameter_std_names
from strainfmu.interface.sensor_variables import reading_names, temperature_names
from strainfmu.interface.zero_variables import TARE_STATE

STEP_SIZE = 0.25
N_ROWS = 41

CHI_SQUARE_DECIMALS = 9
"""Of the chi-square."""

TRUTH = "extra/strainfmu/reference_truth.csv"
"""What the outputs of the estimator's run would be without errors, of those whose truth the flight states."""

_SEEDS = range(21, 26)
"""Of the errors, in the order of trial."""

_LS_REF = "org.fmi-standard.fmi-ls-ref"


@dataclass(frozen=True, eq=False)
class ReferenceRun:
    """Input and expected output of the scalar interface.

    Attributes
    ----------
    time : (n,) [s], in equal steps.
    inputs : (n,) by name of the input that varies.
    outputs : (n,) by name of the output.
    truth : (n,) by name of the output, for outputs whose truth is known.
    fault : fault of one gauge, in the rows of the outputs; None for none.
    """

    time: NDArray[np.float64]
    inputs: Mapping[str, NDArray[np.float64]]
    outputs: Mapping[str, NDArray[np.float64]]
    truth: Mapping[str, NDArray[np.float64]] = field(default_factory=dict)
    fault: Fault | None = None


def reference_run(inverse_map: InverseMap) -> ReferenceRun:
    """Return a flight that ``inverse_map`` covers, with errors as the map states them, and a gauge that fails.

    Inputs come from :func:`~strainfmu.fmu.reference_run.readings.reference_readings`. Errors are the first of a
    few draws with which health is OK but for the fault: 1 flight in some hundred has a false alarm, and an example
    shows the usual case.
    """
    readings = reference_readings(inverse_map, N_ROWS)
    for seed in _SEEDS:
        run = _run(inverse_map, readings, seed)
        if is_usual(run):
            break
    return run


def is_usual(run: ReferenceRun) -> bool:
    """Return whether the gauge's fault is the only alarm of ``run``, and is found in each of its rows.

    After strain that does not fit the tables, the nonlinear estimator uses the loads of the linear map for a few
    steps: these are DEGRADED.
    """
    assert run.fault is not None
    state, fails = run.outputs[STATE], run.fault.fails
    named = run.outputs[SUSPECT_GAUGE] == run.fault.gauge + 1
    after = np.cumsum(fails) > 0
    returns = after & (np.cumsum(after & ~fails) < POLICIES.return_after)
    allowed = (state == HealthState.OK) | (returns & (state == HealthState.DEGRADED))
    return bool(np.all(np.where(fails, np.isin(state, FAULT_STATES) & named, allowed)))


def _run(inverse_map: InverseMap, readings: Readings, seed: int) -> ReferenceRun:
    time = [round(STEP_SIZE * k, 10) for k in range(N_ROWS)]
    rows, truth = readings.sample(seed)
    rows = rounded(rows * inverse_map.sensors.scale + inverse_map.zero_offset)
    values = np.array(
        [
            [*output_values(estimate, bool(groups_of_outputs(inverse_map))), float(TareState.IDLE)]
            for estimate in _estimates(inverse_map, rows, readings.known)
        ]
    )
    names = [variable.name for variable in estimator_interface(inverse_map) if variable.causality == "output"]
    estimated = [name for name in names if name != TARE_STATE]
    signals = dict(zip([*estimated, TARE_STATE], as_recorded(values).T, strict=True))
    # As many states as gauges leave no residual: then chi-square is round-off, whose digits follow the processor.
    signals[CHI_SQUARE] = np.round(signals[CHI_SQUARE], CHI_SQUARE_DECIMALS)
    return ReferenceRun(
        np.array(time),
        {**dict(zip(reading_names(inverse_map), rows.T, strict=True)), **readings.known},
        signals,
        truth={name: as_recorded(values) + 0.0 for name, values in truth.items()},
        fault=replace(readings.fault, fails=as_recorded(readings.fault.fails)),
    )


def _estimates(
    inverse_map: InverseMap, rows: NDArray[np.float64], known: Mapping[str, NDArray[np.float64]]
) -> list[Estimate]:
    """Return the estimates of readings ``rows`` (n, n_d) and the inputs ``known`` by name, step by step."""
    step = Estimator(inverse_map).track
    arguments = [
        step_arguments(inverse_map, {name: float(v[k]) for name, v in known.items()}) for k in range(len(rows))
    ]
    return [step(row, **flow) for row, flow in zip(rows, arguments, strict=True)]


def step_arguments(inverse_map: InverseMap, known: Mapping[str, float]) -> dict[str, Any]:
    """Return the arguments of an estimator's step for inputs ``known`` by the names of the FMU."""
    temperatures = temperature_names(inverse_map.thermal)
    grouped = {
        "parameters": dict(zip(parameter_names_of(inverse_map), parameter_names(inverse_map), strict=True)),
        "parameters_std": dict(
            zip(parameter_names_of(inverse_map), parameter_std_names(inverse_map), strict=False)
        ),
    }
    arguments: dict[str, Any] = {name: value for name, value in known.items() if name in FLOW_INPUTS}
    for argument, names in grouped.items():
        if names:
            arguments[argument] = {name: known[signal] for name, signal in names.items()}
    if temperatures:
        arguments[TEMPERATURE] = [known[name] for name in temperatures]
    return arguments


def as_recorded(values: NDArray[Any]) -> NDArray[Any]:
    """Return (n, ..) ``values`` as an importer records them that holds inputs over a step."""
    return np.concatenate([values[:1], values[:-1]])


def signal_table(
    time: Sequence[float] | NDArray[np.float64],
    signals: Mapping[str, NDArray[np.float64]],
    interface: Sequence[Variable],
    digits: int | None = None,
) -> bytes:
    """Return CSV of ``signals`` as the rules for compatibility information of FMI require it.

    Comma, names in quotes, "time" first, no units, elements of an array separated by blanks. A table of time
    alone, as of an FMU without inputs, has a blank at the end of each line: FMU Compliance Checker takes what
    follows the first name for the separator, and FMPy reads no empty column. ``digits`` None writes all of them.
    """
    columns = {}
    for variable in interface:
        if variable.dimension is None and variable.name in signals:
            columns[variable.name] = [_text(value, variable, digits) for value in signals[variable.name]]
        elif variable.dimension is not None:
            elements = array_elements(variable)
            if all(name in signals for name in elements):
                rows = zip(*(signals[name] for name in elements), strict=True)
                columns[variable.name] = [" ".join(_text(v, variable, digits) for v in row) for row in rows]
    lines = [",".join(f'"{name}"' for name in ("time", *columns))]
    lines += [",".join([f"{t:.10g}", *row]) for t, *row in zip(time, *columns.values(), strict=True)]
    end = "\n" if columns else " \n"
    return "".join(line + end for line in lines).encode()


def array_elements(variable: Variable) -> tuple[str, ...]:
    """Return the scalar names behind an array of the estimator's interface."""
    coefficients, n = tuple(COEFFICIENTS), variable.dimension or 0
    forces, moments = ("axial", "normal", "side"), ("pitch", "yaw")
    known = {
        COEFFICIENT_ARRAY: coefficients,
        "sigma.coefficients": tuple(f"sigma.{name}" for name in coefficients),
        FORCE: tuple(f"force.{name}" for name in forces),
        MOMENT: tuple(f"moment.{name}" for name in moments),
        "sigma.force": tuple(f"sigma.force.{name}" for name in forces),
        "sigma.moment": tuple(f"sigma.moment.{name}" for name in moments),
    }
    return known.get(variable.name, tuple(f"{variable.name}[{i}]" for i in range(1, n + 1)))


def _text(value: float, variable: Variable, digits: int | None) -> str:
    if variable.fmi_type != "Real":
        return str(int(value))
    return repr(float(value)) if digits is None else f"{value:.{digits}g}"


def layered_standard_files(run: ReferenceRun, interface: Sequence[Variable]) -> dict[str, bytes]:
    """Return content by name of the layered standard FMI-LS-REF: reference input and output, and their manifest.

    Output is given to 6 digits, which every machine rounds alike. Source: FMI-LS-REF 1.0.0-beta.1.
    """
    namespace = "http://fmi-standard.org/fmi-ls-manifest"
    root = Element(
        "fmiReferences",
        {
            "xmlns:fmi-ls": namespace,
            "fmi-ls:fmi-ls-name": _LS_REF,
            "fmi-ls:fmi-ls-version": "1.0.0-beta.1",
            "fmi-ls:fmi-ls-description": "Related files: reference input and output",
        },
    )
    files = {
        "reference_in.csv": ("experiment", signal_table(run.time, run.inputs, interface)),
        "reference_out.csv": ("result", signal_table(run.time, run.outputs, interface, digits=6)),
    }
    for name, (role, _) in files.items():
        SubElement(root, "Related", {"role": role, "source": name, "type": "text/csv"})
    indent(root)
    manifest = tostring(root, encoding="UTF-8", xml_declaration=True)
    folder = f"extra/{_LS_REF}"
    return {
        f"{folder}/fmi-ls-manifest.xml": manifest,
        **{f"{folder}/{name}": content for name, (_, content) in files.items()},
    }
