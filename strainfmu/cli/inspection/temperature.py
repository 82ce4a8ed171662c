"""What a map knows of the wall's temperature, as tables: ``strainfmu inspect map.h5``."""

from __future__ import annotations

from math import sqrt

import numpy as np
from rich.box import SIMPLE_HEAD
from rich.markup import escape
from rich.table import Table

from strainfmu.arrays import FloatArray
from strainfmu.estimator.map.sensors import ThermalMap
from strainfmu.estimator.reference.readings import amplitudes

MICRO = 1e6


def temperature_table(thermal: ThermalMap) -> Table:
    """Return modes and slopes, and what thermal strain the sensors leave in the gauges."""
    table = plain_table("Temperature of the wall", "quantity", "value")
    slopes = (("gauge factor", thermal.gauge_factor_slope), ("modulus", thermal.modulus_slope))
    table.add_row("reference", f"{thermal.reference_temperature:.6g} K")
    table.add_row("modes, prior sigmas", f"{len(thermal.prior_std)}, {_range(thermal.prior_std)} K")
    for name, slope in slopes:
        table.add_row(name, f"{1e4 * slope:.3g} % per 100 K")
    coefficients = ", ".join(f"{MICRO * one:.3g}" for one in thermal.apparent_strain)
    table.add_row(escape("apparent strain by powers of the rise [um/m, K]"), coefficients or "none")
    at_rest, strain = np.full((1, thermal.n_sensors), thermal.reference_temperature), thermal.linear_strain
    for name, known in (("no sensor", False), ("all sensors", True)):
        left = amplitudes(thermal, at_rest, np.full(thermal.n_sensors, known)).covariance
        rms = MICRO * sqrt(max(float(np.mean(np.sum((strain @ left) * strain, axis=1))), 0.0))
        table.add_row(escape(f"thermal strain left with {name}, rms of the gauges [um/m]"), f"{rms:.3g}")
    return table


def temperature_sensors(thermal: ThermalMap) -> Table:
    """Return the sensors: number, name and standard deviation."""
    table = plain_table("Temperature sensors", "sensor", "input", "sigma [K]")
    for number, (name, std) in enumerate(zip(thermal.sensor_names, thermal.sensor_std, strict=True), start=1):
        table.add_row(escape(name), escape(f"temperature[{number}]"), f"{std:.3g}")
    return table


def _range(values: FloatArray) -> str:
    low, high = float(values.min()), float(values.max())
    return f"{low:.3g}" if low == high else f"{low:.3g} to {high:.3g}"


def plain_table(title: str, *headings: str) -> Table:
    """Return a table without rows."""
    table = Table(title=title, box=SIMPLE_HEAD, padding=(0, 1, 0, 0), pad_edge=False)
    for heading in headings:
        table.add_column(escape(heading), overflow="fold")
    return table
