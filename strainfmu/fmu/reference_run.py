"""A short run that an importer can repeat: input, expected output, and what the FMU and its page show of both.

An importer of co-simulation holds inputs over a step, so what it records at the end of a step belongs to the
inputs at its start. The expected output is that: row 0 of the first input, row k of the input of row k - 1.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import pi, sin
from xml.etree.ElementTree import Element, SubElement, indent, tostring

import numpy as np
from numpy.typing import NDArray

from strainfmu.estimator.inverse_map import InverseMap
from strainfmu.estimator.step import Estimator
from strainfmu.interface.estimator_variables import estimator_interface, output_values
from strainfmu.interface.fmi_variables import COEFFICIENTS, Variable, strain_names

STOP_TIME = 1.0
STEP_SIZE = 0.1
N_ROWS = 11

INPUT_FORMAT = ".9g"
"""Of inputs: files hold exactly what the outputs belong to."""

CHI_SQUARE_DECIMALS = 9
"""Of the chi-square; what is smaller is round-off, and follows the processor."""

_LS_REF = "org.fmi-standard.fmi-ls-ref"
_COLOURS = ("#1b6ca8", "#c0392b", "#2e8b57", "#8e44ad", "#b8860b")


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
    """Return a run in which each state swings at its own frequency, within the strains of the snapshots.

    Strains are rounded to 9 digits, so that files hold exactly what the outputs belong to. Dynamic pressure keeps
    its start value: FMPy 0.3 takes no table with an array and a scalar of one type.
    """
    time = [round(STEP_SIZE * k, 10) for k in range(N_ROWS)]
    rows = [_strain(inverse_map, t) for t in time]
    strain = np.array([[float(format(value, INPUT_FORMAT)) for value in row] for row in rows])
    q, estimator = inverse_map.nominal_dynamic_pressure, Estimator(inverse_map)
    values = np.array([output_values(estimator.step(row, q)) for row in strain])
    held = np.concatenate([values[:1], values[:-1]])
    outputs = [variable.name for variable in estimator_interface(inverse_map) if variable.causality == "output"]
    signals = dict(zip(outputs, held.T, strict=True))
    # The strains fit the states, so that chi-square is round-off, whose digits follow the processor.
    signals["health.chi_square"] = np.round(signals["health.chi_square"], CHI_SQUARE_DECIMALS)
    names = strain_names(inverse_map.n_gauges)
    return ReferenceRun(np.array(time), dict(zip(names, strain.T, strict=True)), signals)


def _strain(inverse_map: InverseMap, time: float) -> NDArray[np.float64]:
    """Return (n_d,) strain [m/m] of states that divide the range of the snapshots evenly."""
    operator = inverse_map.state_operator
    largest = np.max(np.abs(operator), axis=0)
    part = float(np.max(inverse_map.strain_range)) / operator.shape[1]
    swing = [sin(2.0 * pi * (0.5 + 0.25 * k) * time) for k in range(operator.shape[1])]
    amplitude = part / np.where(largest > 0.0, largest, np.inf) * np.array(swing)
    return np.asarray(inverse_map.mean_strain + np.sum(operator * amplitude, axis=1))


def signal_table(
    time: Sequence[float] | NDArray[np.float64],
    signals: Mapping[str, NDArray[np.float64]],
    interface: Sequence[Variable],
    digits: int = 17,
) -> bytes:
    """Return CSV of ``signals`` as the rules for compatibility information of FMI require it.

    Comma, names in quotes, "time" first, no units, elements of an array separated by blanks.
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
    return ("\n".join(lines) + "\n").encode()


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


def example_plot(run: ReferenceRun) -> str:
    """Return an SVG of the coefficients of ``run`` over time, each with its band of 3 sigma."""
    height, width, left = 110, 640, 70
    parts = []
    for k, (name, colour) in enumerate(zip(COEFFICIENTS, _COLOURS, strict=True)):
        value, sigma = run.outputs[name], 3.0 * run.outputs[f"sigma.{name}"]
        low, high = float(np.min(value - sigma)), float(np.max(value + sigma))
        x = left + (width - left - 10) * run.time / run.time[-1]
        top = k * height + 12

        def y(values: NDArray[np.float64], top: int = top, low: float = low, high: float = high) -> list[float]:
            return (top + (height - 30) * (high - values) / (high - low)).tolist()

        upper = [f"{a:.1f},{b:.1f}" for a, b in zip(x, y(value + sigma), strict=True)]
        lower = [f"{a:.1f},{b:.1f}" for a, b in zip(x, y(value - sigma), strict=True)]
        line = [f"{a:.1f},{b:.1f}" for a, b in zip(x, y(value), strict=True)]
        parts += [
            f'<polygon points="{" ".join([*upper, *lower[::-1]])}" fill="{colour}" fill-opacity=".2"/>',
            f'<polyline points="{" ".join(line)}" fill="none" stroke="{colour}" stroke-width="1.5"/>',
            f'<text x="4" y="{top + 40}">{name} [1]</text>',
            f'<text x="{left - 4}" y="{top + 8}" text-anchor="end" font-size="9">{high:.3g}</text>',
            f'<text x="{left - 4}" y="{top + height - 30}" text-anchor="end" font-size="9">{low:.3g}</text>',
        ]
    total = len(COEFFICIENTS) * height + 10
    axis = f'<text x="{width // 2}" y="{total - 4}">time, 0 to {run.time[-1]:g} s</text>'
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {total}" width="{width}" '
        f'font-family="sans-serif" font-size="12" role="img" '
        f'aria-label="Coefficients with 3 sigma bands">{"".join(parts)}{axis}</svg>'
    )
