"""Inspection of a map, as tables and figures: ``strainfmu inspect map.h5``."""

from collections.abc import Iterator
from dataclasses import is_dataclass
from math import degrees
from pathlib import Path
from typing import Any, Literal

import numpy as np
from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from strainfmu.arrays import FloatArray, inverse_root
from strainfmu.cli.inspection.provenance import provenance_rows
from strainfmu.estimator.air_inputs import VIBRATION
from strainfmu.estimator.health import FALSE_ALARM_PROBABILITY, outlier_threshold
from strainfmu.estimator.health import detectable_bias as detected_bias
from strainfmu.estimator.map.inverse_map import (
    COEFFICIENT_NAMES,
    LOAD_NAMES,
    LOAD_UNITS,
    SCHEMA,
    SCHEMA_VERSION,
    InverseMap,
    load_inverse_map,
)
from strainfmu.estimator.map.schema import Entry, entries, left_out
from strainfmu.estimator.map.sensors import CHANNELS, InertiaMap, ThermalMap, shown_units
from strainfmu.estimator.other_loads import FIVE_LOADS
from strainfmu.estimator.policies import POLICIES
from strainfmu.estimator.reference.gain import load_covariance, residual_precision
from strainfmu.estimator.reference.readings import amplitudes
from strainfmu.estimator.valid_ranges import RECORDED_KEYS, valid_ranges
from strainfmu.files import content_hash_of

MICRO = 1e6
EIGENVALUES_SHOWN = 12
CASE_NAMES = {1: "1, least squares on POD modes", 2: "2, low-rank Gaussian prior"}

VALUES_SHOWN = 8
"""Of an array; of a longer one its range."""

SHOWN_UNITS = {"rad": (180.0 / np.pi, "deg"), "m/m": (MICRO, "um/m")}
"""Of values in these units, factor to what users see, and its unit."""

NAMED = ("gauge", "coefficient", "term", "data", "channel", "sensor")
"""Headings of columns of names, which are not broken."""

SHOWN_APART = (
    *RECORDED_KEYS.values(),
    "noise_terms",
    "table_error_terms",
    "hessian_eigenvalues",
    "gamma",
    "gamma_rule",
    "recoverable_modes",
)
"""Entries of the provenance that have tables or rows of their own."""


def inspect_map(path: Path, folder: Path | None, console: Console) -> None:
    """Show what the map at ``path`` holds; draw figures into ``folder`` if one is given.

    Raises
    ------
    InputError
        The file is missing, damaged or of another version.
    StrainfmuError
        A figure could not be written, or matplotlib is missing.
    """
    loaded = load_inverse_map(path)
    content_hash = content_hash_of(path, SCHEMA, SCHEMA_VERSION)
    console.print(_summary(loaded, f"{path}: {loaded.vehicle}", content_hash))
    console.print(_validity(loaded))
    console.print(_noise(loaded))
    if loaded.manifold is not None:
        console.print(_table_errors(loaded))
    if loaded.case == 2:
        console.print(_eigenvalues(loaded))
    console.print(_coefficients(loaded))
    console.print(_gauges(loaded))
    if loaded.has_temperature:
        for table in _temperature(loaded.thermal):
            console.print(table)
    if loaded.inertia is not None:
        console.print(_inertia(loaded.inertia))
    for table in _data(loaded, "Data of the map"):
        console.print(table)
    if folder is not None:
        for name in _draw(loaded, folder):
            console.print(f"{folder / name}: written", highlight=False, markup=False, soft_wrap=True)


def hessian_eigenvalues(inverse_map: InverseMap) -> FloatArray:
    """Return (k,) lambda of the prior-preconditioned Hessian of a map of Case 2, falling [1]."""
    whitened = inverse_root(inverse_map.noise_covariance) @ inverse_map.state_operator
    return np.asarray(np.linalg.svd(whitened, compute_uv=False) ** 2)


def detectable_bias(inverse_map: InverseMap) -> FloatArray:
    """Return (n_d,) the smallest bias of each gauge [m/m] that its z-score detects in 99 % of the cases.

    At the estimator's rate of false alarms, shared among the gauges; infinite where no other gauge checks one.
    """
    precision = np.diag(residual_precision(inverse_map))
    floor = POLICIES.min_information * np.sum(inverse_root(inverse_map.noise_covariance) ** 2, axis=0)
    threshold = outlier_threshold(inverse_map.n_gauges, FALSE_ALARM_PROBABILITY)
    return detected_bias(np.where(precision < floor, 0.0, precision), threshold)


def _summary(loaded: InverseMap, title: str, content_hash: str) -> Table:
    table = Table(title=escape(title), show_header=False, box=SIMPLE_HEAD, padding=(0, 1, 0, 0), pad_edge=False)
    table.add_column()
    table.add_column(overflow="fold")
    table.add_row("content hash", content_hash)
    table.add_row("estimator", "linear" if loaded.manifold is None else "nonlinear, with the linear one")
    table.add_row("case of the linear map", CASE_NAMES[loaded.case])
    table.add_row("gauges, states", f"{loaded.n_gauges}, {loaded.n_states}")
    if loaded.case == 2:
        rule = str(loaded.provenance.get("gamma_rule", "unknown")).replace("_", " ")
        table.add_row("gamma, found by", f"{loaded.regularisation:.6g}, {escape(rule)}")
    table.add_row("degrees of freedom of chi-square", str(loaded.residual_degrees_of_freedom))
    # Maps state the choice of modes in full, but older ones only which were skipped.
    in_choice = ("modes_skipped",) if "mode_choice" in loaded.provenance else ()
    for row in provenance_rows(loaded.provenance, (*SHOWN_APART, *in_choice)):
        table.add_row(*map(escape, row))
    return table


def _validity(loaded: InverseMap) -> Table:
    table = _table("Valid over what the snapshots cover", ("quantity", "range"))
    for valid in valid_ranges(loaded):
        table.add_row(escape(valid.quantity), valid.text)
    return table


def _noise(loaded: InverseMap) -> Table:
    """Return the noise terms; of a map that does not name them, the gauges' own noise."""
    table = _table("Noise, terms of its covariance", ("term",), "fraction [%]", "rms [um/m]")
    rms = MICRO * float(np.sqrt(np.mean(loaded.noise_std**2)))
    known = loaded.provenance.get("noise_terms") or [{"name": "gauge noise", "rms_strain": rms / MICRO}]
    for term in known:
        share = f"{100.0 * term['share']:.1f}" if "share" in term else "-"
        table.add_row(escape(str(term["name"])), share, f"{MICRO * term['rms_strain']:.3g}")
    return table


def _data(record: Any, title: str) -> Iterator[Table]:
    """Yield a table of what ``record`` holds, as its schema states it, then tables of the records in it."""
    table = _table(title, ("data", "shape", "values", "unit", "meaning"))
    absent = left_out(record)
    present = [(name, stated, getattr(record, name)) for name, stated in entries(record).items()]
    present = [row for row in present if row[0] not in absent and row[2] is not None and np.size(row[2])]
    for name, stated, value in present:
        if not is_dataclass(value):
            shape = " x ".join(map(str, np.shape(value)))
            table.add_row(name, shape, *map(escape, _values(stated, value)), escape(stated.meaning))
    yield table
    for name, _, value in present:
        if is_dataclass(value):
            yield from _data(value, f"{title}: {name.replace('_', ' ')}")


def _values(stated: Entry, value: Any) -> tuple[str, str]:
    """Return a text of ``value``, few numbers or their range, and its unit as users see it."""
    factor, unit = SHOWN_UNITS.get(stated.unit, (1.0, stated.unit))
    if isinstance(value, str | tuple):
        texts = [value] if isinstance(value, str) else [*dict.fromkeys(value)]
        return ", ".join(texts if len(texts) <= 4 else [*texts[:3], "..", texts[-1]]), unit
    numbers = factor * np.ravel(np.asarray(value, dtype=float))
    if numbers.size > VALUES_SHOWN:
        return f"{numbers.min():.4g} to {numbers.max():.4g}", unit
    return ", ".join(f"{number:.6g}" for number in numbers), unit


def _table_errors(loaded: InverseMap) -> Table:
    """Return what pressure that the tables do not hold strains, term by term."""
    table = _table("Nonlinear estimator: errors of the tables", ("term",), "rms strain [um/m]")
    for term in loaded.provenance.get("table_error_terms", []):
        table.add_row(escape(str(term["name"])), f"{MICRO * term['rms_strain']:.3g}")
    return table


def _eigenvalues(loaded: InverseMap) -> Table:
    values, gamma = hessian_eigenvalues(loaded), loaded.regularisation
    above = int(np.sum(values >= gamma))
    title = (
        f"Eigenvalues of the prior-preconditioned Hessian: {above} of {len(values)} at least gamma, {gamma:.4g}"
    )
    shown = min(EIGENVALUES_SHOWN, len(values))
    table = _table(title, (), "number", "eigenvalue [1]", "decided by the data [%]")
    for number, value in enumerate(values[:shown], start=1):
        table.add_row(str(number), f"{value:.4g}", f"{100.0 * value / (value + gamma):.1f}")
    if shown < len(values):
        table.add_row(f"{len(values)}", f"{values[-1]:.4g}", f"{100.0 * values[-1] / (values[-1] + gamma):.1f}")
    return table


def _coefficients(loaded: InverseMap) -> Table:
    q = loaded.nominal_dynamic_pressure
    per_force = q * loaded.reference_area
    scale = per_force * np.array([1.0, 1.0, 1.0, loaded.reference_length, loaded.reference_length])
    std = np.sqrt(np.diag(load_covariance(loaded))[FIVE_LOADS])
    numbers = ("minimum [1]", "maximum [1]", "sigma [1]", "of range [%]", "sigma of load")
    whose = "" if loaded.manifold is None else " of the linear map"  # those of the other follow the flight
    title = f"Coefficients over the snapshots, and sigma{whose} at q_inf = {1e-3 * q:.4g} kPa"
    table = _table(title, ("coefficient",), *numbers, last=("load",))
    rows = zip(COEFFICIENT_NAMES, loaded.coefficient_range, std, std / scale, LOAD_NAMES, LOAD_UNITS, strict=True)
    for name, (low, high), of_load, sigma, load, unit in rows:
        of_range = f"{100.0 * sigma / (high - low):.2f}" if high - low > 1e-6 * sigma else "-"
        values = *(_rounded(value) for value in (low, high, sigma)), of_range, f"{of_load:.4g} {unit}"
        table.add_row(name, *values, load.replace("_", " "))
    return table


def _rounded(value: float) -> str:
    """Return four decimals; what rounds to 0 has no sign."""
    return f"{round(value, 4) + 0.0:.4f}"


def _gauges(loaded: InverseMap) -> Table:
    numbers = ("x [m]", "y [m]", "z [m]", "roll [deg]", "sigma [um/m]", "noticed bias [um/m]", "|strain| [um/m]")
    title = (
        "Gauges: position, noise, smallest bias detected in 99 % of the cases, largest |strain| of the snapshots"
    )
    table = _table(title, ("gauge",), *numbers)
    bias = detectable_bias(loaded)
    shown = shown_units(loaded.sensors)
    for i, (name, unit) in enumerate(zip(loaded.gauge_names, shown, strict=True)):
        x, y, z = loaded.gauge_position[i]
        roll = degrees(np.arctan2(y, z)) % 360.0
        table.add_row(
            escape(name),
            *(f"{round(value, 4) + 0.0:.4g}" for value in (x, y, z)),
            f"{roll if roll < 360.0 - 1e-9 else 0.0:.4g}",
            _reading(loaded.noise_std[i], *unit),
            _reading(bias[i], *unit) if np.isfinite(bias[i]) else "never",
            _reading(loaded.strain_range[i], *unit),
        )
    return table


def _reading(value: float, factor: float, unit: str) -> str:
    """Return ``factor`` times a value; the unit of strain is in the heading."""
    return f"{factor * value:.3g}" + ("" if unit == "um/m" else f" {unit}")


def _temperature(thermal: ThermalMap) -> Iterator[Table]:
    """Yield the thermal strain that sensors leave in the gauges, and the sensors."""
    table = _table("Temperature: thermal strain left in the gauges, rms", ("known",), "strain [um/m]")
    at_rest, strain = np.full((1, thermal.n_sensors), thermal.reference_temperature), thermal.linear_strain
    for name, known in (("no sensor", False), ("all sensors", True)):
        remaining = amplitudes(thermal, at_rest, np.full(thermal.n_sensors, known)).covariance[0]
        variance = max(float(np.mean(np.sum((strain @ remaining) * strain, axis=1))), 0.0)
        table.add_row(name, f"{MICRO * np.sqrt(variance):.3g}")
    yield table
    table = _table("Temperature sensors", ("sensor", "input"), "sigma [K]")
    for number, (name, std) in enumerate(zip(thermal.sensor_names, thermal.sensor_std, strict=True), start=1):
        table.add_row(escape(name), escape(f"temperature[{number}]"), f"{std:.3g}")
    yield table


def _inertia(inertia: InertiaMap) -> Table:
    """Return each channel with its standard deviations, and the strain that it leaves in the gauges, rms."""
    table = _table("Inertia", ("channel", "not measured, sigma", "um/m", "measured, sigma", "um/m"))
    of_strain = MICRO * np.sqrt(np.mean(inertia.mode_strain**2, axis=0))
    rows = zip(CHANNELS, inertia.prior_std.tolist(), inertia.sensor_std.tolist(), of_strain.tolist(), strict=True)
    for name, prior, error, strain in rows:
        remaining = (prior**-2 + error**-2) ** -0.5
        table.add_row(
            escape(name), f"{prior:.3g}", f"{prior * strain:.3g}", f"{error:.3g}", f"{remaining * strain:.3g}"
        )
    rms = float(np.sqrt(np.mean(np.sum(inertia.vibration_strain**2, axis=1))))
    stated = MICRO * inertia.vibration_std
    table.add_row(VIBRATION, f"{stated:.3g} um/m", f"{stated * rms:.3g}", "as given", "")
    return table


def _draw(loaded: InverseMap, folder: Path) -> list[str]:
    """Draw the figures that need the map alone and return the names of the files."""
    from builder.figures import gauge_figures as gauges
    from builder.figures import uncertainty
    from builder.figures.drawing import save
    from builder.reports.findings.gauge_value import gauge_value

    value = gauge_value(loaded)
    figures = {
        "gauge_loss.png": gauges.gauge_loss(
            loaded, growth=value.growth, detectable_bias=value.detectable_bias, leverage=value.leverage
        ),
        "pair_loss.png": gauges.pair_loss(
            loaded, growth=value.growth, pairs=value.pairs, pair_growth=value.pair_growth
        ),
        "correlations.png": uncertainty.correlations(loaded),
    }
    if loaded.case == 2:
        values = hessian_eigenvalues(loaded)
        figures["eigenvalues.png"] = uncertainty.eigenvalues(values, loaded.regularisation)
    for name, shown in figures.items():
        save(shown.figure, folder / name)
    return list(figures)


def _table(title: str, words: tuple[str, ...], *numbers: str, last: tuple[str, ...] = ()) -> Table:
    """Return an empty table; headings are shown as they are, units in brackets are no markup."""
    table = Table(title=escape(title), box=SIMPLE_HEAD, padding=(0, 1, 0, 0), pad_edge=False)
    justified: list[tuple[str, Literal["left", "right"]]] = [
        *((heading, "left") for heading in words),
        *((heading, "right") for heading in numbers),
        *((heading, "left") for heading in last),
    ]
    for number, (heading, justify) in enumerate(justified):
        is_name = heading in NAMED and number == 0
        table.add_column(escape(heading), justify=justify, overflow="fold", no_wrap=is_name)
    return table
