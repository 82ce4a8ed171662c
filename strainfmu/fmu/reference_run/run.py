"""A short run that an importer can repeat: input, expected output, and what the FMU holds of both.

An importer of co-simulation holds inputs over a step, so what it records at the end of a step belongs to the
inputs at its start. The expected output is that: row 0 of the first input, row k of the input of row k - 1.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from xml.etree.ElementTree import Element, SubElement, indent, tostring

import numpy as np
from numpy.typing import NDArray

from strainfmu.estimator.estimates.load_estimate import LoadEstimate
from strainfmu.estimator.linear.estimator import Estimator
from strainfmu.estimator.manifold.estimator import ManifoldEstimator
from strainfmu.estimator.manifold.tracker import FlightTracker
from strainfmu.estimator.map.inverse_map import InverseMap
from strainfmu.estimator.map.offers import has_further_outputs
from strainfmu.estimator.zeros.tare_edge import TareState
from strainfmu.fmu.reference_run.strains import reference_strains
from strainfmu.interface.estimator_variables import estimator_interface, output_values
from strainfmu.interface.fmi_variables import COEFFICIENTS, Variable
from strainfmu.interface.sensor_variables import reading_names

STEP_SIZE = 0.05
N_ROWS = 21

INPUT_FORMAT = ".9g"
"""Of inputs: files hold exactly what the outputs belong to."""

CHI_SQUARE_DECIMALS = 9
"""Of the chi-square."""

_LS_REF = "org.fmi-standard.fmi-ls-ref"


@dataclass(frozen=True, eq=False)
class ReferenceRun:
    """Input and expected output of the scalar interface.

    Attributes
    ----------
    time : (n,) [s], in equal steps.
    inputs : (n,) by name of the input that varies.
    outputs : (n,) by name of the output.
    """

    time: NDArray[np.float64]
    inputs: Mapping[str, NDArray[np.float64]]
    outputs: Mapping[str, NDArray[np.float64]]


def reference_run(inverse_map: InverseMap) -> ReferenceRun:
    """Return a run within what the snapshots cover, with errors as the map states them, and a gauge that fails.

    Strains, and readings of further sensors without thrust, are those of
    :func:`~strainfmu.fmu.reference_run.strains.reference_strains`, rounded to 9 digits, so that files hold exactly
    what the outputs belong to. Navigation keeps its start values: FMPy 0.3 takes no table with an array and a
    scalar of one type, as that of FMI 3.0 is with further sensors.
    """
    time = [round(STEP_SIZE * k, 10) for k in range(N_ROWS)]
    rows, _ = reference_strains(inverse_map, N_ROWS)
    rows = rows if inverse_map.sensors is None else rows * inverse_map.sensors.scale
    strain = np.array([[float(format(value, INPUT_FORMAT)) for value in row] for row in rows.tolist()])
    values = np.array(
        [
            [*output_values(one, has_further_outputs(inverse_map)), float(TareState.IDLE)]
            for one in _estimates(inverse_map, strain)
        ]
    )
    held = np.concatenate([values[:1], values[:-1]])
    outputs = [variable.name for variable in estimator_interface(inverse_map) if variable.causality == "output"]
    signals = dict(zip(outputs, held.T, strict=True))
    # As many states as gauges leave no residual: then chi-square is round-off, whose digits follow the processor.
    signals["health.chi_square"] = np.round(signals["health.chi_square"], CHI_SQUARE_DECIMALS)
    names = reading_names(inverse_map)
    return ReferenceRun(np.array(time), dict(zip(names, strain.T, strict=True)), signals)


def _estimates(inverse_map: InverseMap, strain: NDArray[np.float64]) -> list[LoadEstimate]:
    if inverse_map.manifold is not None:
        tracker = FlightTracker(ManifoldEstimator(inverse_map))
        return [tracker.step(row) for row in strain]
    q, estimator = inverse_map.nominal_dynamic_pressure, Estimator(inverse_map)
    return [estimator.step(row, q) for row in strain]


def signal_table(
    time: Sequence[float] | NDArray[np.float64],
    signals: Mapping[str, NDArray[np.float64]],
    interface: Sequence[Variable],
    digits: int = 17,
) -> bytes:
    """Return CSV of ``signals`` as the rules for compatibility information of FMI require it.

    Comma, names in quotes, "time" first, no units, elements of an array separated by blanks. A table of time
    alone, that of an FMU without inputs, has a blank at the end of each line: FMU Compliance Checker takes what
    follows the first name for the separator, and FMPy reads no empty column.
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
        "coefficients": coefficients,
        "sigma.coefficients": tuple(f"sigma.{name}" for name in coefficients),
        "force": tuple(f"force.{name}" for name in forces),
        "moment": tuple(f"moment.{name}" for name in moments),
        "sigma.force": tuple(f"sigma.force.{name}" for name in forces),
        "sigma.moment": tuple(f"sigma.moment.{name}" for name in moments),
    }
    return known.get(variable.name, tuple(f"{variable.name}[{i}]" for i in range(1, n + 1)))


def _text(value: float, variable: Variable, digits: int) -> str:
    return f"{value:.{digits}g}" if variable.fmi_type == "Real" else str(int(value))


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
        "reference_in.csv": ("experiment", signal_table(run.time, run.inputs, interface, digits=9)),
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
