"""``documentation/`` of an FMU: one HTML page that needs no other file, and the texts beside it.

Source of the folder and file names: FMI 2.0.5, section 2.3.
"""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from importlib import resources
from typing import TYPE_CHECKING

from strainfmu.fmu.model_description import FmuDescription
from strainfmu.interface import HEALTH_ITEMS, HEALTH_TYPE, UNITS, Variable
from strainfmu.inverse_map import COEFFICIENT_NAMES

if TYPE_CHECKING:
    from strainfmu.cosim.flight_model import FlightModel
    from strainfmu.cosim.trajectory import Trajectory
    from strainfmu.inverse_map import InverseMap

_STYLE = (
    "body{font-family:sans-serif;max-width:60em;margin:2em auto;line-height:1.4;color:#222}"
    "table{border-collapse:collapse;font-size:90%}"
    "td,th{border:1px solid #bbb;padding:.2em .5em;text-align:left}"
    "th{background:#eee}code{background:#f4f4f4}"
)

_HOST = (
    "PythonFMU runs it: the host needs a 64-bit Python 3.11 or newer with numpy and h5py, on Linux or "
    "Windows; externalDependencies.txt says the rest. strainfmu itself need not be installed.",
    "The folder the host unzips it to may hold plain ASCII letters, digits, blanks and . _ - ~ only: "
    "PythonFMU ends the process where it holds others.",
)

Section = tuple[str, Sequence[str]]
"""A heading and its paragraphs, as HTML."""


def documentation_files(fmu: FmuDescription, sections: Sequence[Section]) -> dict[str, bytes]:
    """Return content by name inside ``documentation/``: the page, dependencies and licences."""
    package = resources.files("fmus")
    return {
        "index.html": index_html(fmu, sections).encode(),
        "externalDependencies.txt": package.joinpath("python", "externalDependencies.txt").read_bytes(),
        "licenses/license.txt": package.joinpath("licenses", "license.txt").read_bytes(),
        "licenses/pythonfmu.txt": package.joinpath("licenses", "pythonfmu.txt").read_bytes(),
    }


def index_html(fmu: FmuDescription, sections: Sequence[Section]) -> str:
    """Return the page: ``sections``, then the variables with units, then what the host must offer."""
    parts = [f"<h1>{escape(fmu.model_name)}</h1>", f"<p>{escape(fmu.description)}.</p>"]
    for heading, paragraphs in (
        *sections,
        ("Variables", [_variable_table(fmu.interface)]),
        *([("Health", [_health_table()])] if any(v.declared_type == HEALTH_TYPE for v in fmu.interface) else []),
        ("What the host must offer", _HOST),
    ):
        parts.append(f"<h2>{escape(heading)}</h2>")
        parts.extend(text if text.startswith("<table") else f"<p>{text}</p>" for text in paragraphs)
    return (
        '<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8">'
        f"<title>{escape(fmu.model_name)}</title>"
        f"<style>{_STYLE}</style></head>\n<body>\n" + "\n".join(parts) + "\n</body></html>\n"
    )


def estimator_sections(inverse_map: InverseMap, content_hash: str) -> list[Section]:
    """Return what the estimator's page says before its tables."""
    ranges = ", ".join(
        f"{name} {low:.4g} to {high:.4g}"
        for name, (low, high) in zip(COEFFICIENT_NAMES, inverse_map.coefficient_range, strict=True)
    )
    return [
        (
            "What it computes",
            [
                f"From the strains of {inverse_map.n_gauges} gauges it estimates the aerodynamic forces and "
                "moments by one fixed affine map, and from those and the dynamic pressure the coefficients. "
                "Outputs belong to the inputs last set: at the start, after a step and without one.",
                "Method: Pham, Ghattas, Clemens and Willcox, <i>Real-time aerodynamic load estimation for "
                "hypersonics via strain-based inverse maps</i>.",
                f"Vehicle: {escape(inverse_map.vehicle)}. S = {inverse_map.reference_area:.6g} m², "
                f"L = {inverse_map.reference_length:.6g} m. Map: <code>{content_hash}</code>.",
            ],
        ),
        (
            "Limits",
            [
                f"The map was built from flight conditions with coefficients in these ranges: {ranges}. "
                "Outside them the estimate is an extrapolation.",
                "sigma is one standard deviation, for gauges with the noise the map was built for. C_A is "
                "the fore-body's: base pressure is not measured by strain.",
                "Inputs that are not finite are no error: the outputs they spoil are NaN and health.state "
                "says so. Pressure patterns that leave the gauges without strain cannot be seen.",
            ],
        ),
    ]


def plant_sections(model: FlightModel, trajectory: Trajectory, content_hash: str) -> list[Section]:
    """Return what the plant's page says before its table."""
    return [
        (
            "What it computes",
            [
                f"It flies a stored trajectory of {trajectory.stop_time:g} s and gives the strains that "
                f"{model.n_gauges} gauges would measure, with noise, and the true coefficients to compare "
                "with. After its end the last flight condition stays.",
                "The noise is drawn anew at every communication point; equal seed and steps give the same noise.",
                f"Vehicle: {escape(model.vehicle)}. Flight model: <code>{content_hash}</code>.",
            ],
        ),
        (
            "Limits",
            [
                f"Mach number {model.mach_knots[0]:g} to {model.mach_knots[-1]:g}, total incidence 0 to "
                f"{_degrees(model.incidence_knots[-1]):g} deg, geopotential altitude 0 to 71 km, US Standard "
                "Atmosphere 1976. Steady aerodynamics and a quasi-static structure: no dynamics of either.",
            ],
        ),
    ]


def _degrees(angle: float) -> float:
    """Return ``angle`` [rad] in degrees, with the factor of the display unit."""
    return angle * next(unit for unit in UNITS if unit.name == "rad").display_units[0].factor


def _variable_table(interface: Sequence[Variable]) -> str:
    """Return the table of variables."""
    rows = [
        (
            variable.name,
            variable.causality,
            variable.unit or variable.declared_type or variable.fmi_type,
            variable.display_unit or "",
            "" if variable.start is None else f"{variable.start:g}",
            variable.description,
        )
        for variable in interface
    ]
    return _table(("Name", "Causality", "Unit", "Shown in", "Start", "Description"), rows)


def _health_table() -> str:
    """Return the table of health states."""
    return _table(("Value", "State", "Meaning"), [(str(int(s)), s.name, text) for s, text in HEALTH_ITEMS])


def _table(header: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return an HTML table."""
    head = "".join(f"<th>{escape(cell)}</th>" for cell in header)
    body = "\n".join("<tr>" + "".join(f"<td>{escape(cell)}</td>" for cell in row) + "</tr>" for row in rows)
    return f"<table><tr>{head}</tr>\n{body}</table>"
