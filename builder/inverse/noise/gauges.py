"""Noise of the gauges and further modes of strain error, from the section [noise] of a vehicle file."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from builder.inverse.noise.model import NoiseTerm, nuisance_modes
from builder.vehicle.map.options import Noise
from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError
from strainfmu.text_files import LARGEST, MIB, read_csv, shown_columns

MICRO = 1e-6


def gauge_covariance(entry: Noise, n_gauges: int, median_strain: float, folder: Path) -> FloatArray:
    """Return the covariance (n_gauges, n_gauges) of the gauges' own noise [(m/m)^2].

    Parameters
    ----------
    entry : section [noise].
    n_gauges : n_d.
    median_strain : median |strain| that relative noise refers to [m/m].
    folder : where ``covariance_file`` lies.

    Raises
    ------
    InputError
        The number of values differs from the number of gauges, or a file holds no covariance.
    """
    if entry.covariance_file is not None:
        return MICRO**2 * _covariance_of(folder / entry.covariance_file, n_gauges)
    if entry.std_of_gauges_um_per_m is not None:
        std = MICRO * np.array(entry.std_of_gauges_um_per_m)
        if len(std) != n_gauges:
            raise InputError(f"noise.std_of_gauges_um_per_m: {len(std)} values found, must be {n_gauges}")
        return np.diag(std**2)
    if entry.std_um_per_m is not None:
        return (MICRO * entry.std_um_per_m) ** 2 * np.eye(n_gauges)
    assert entry.percent_of_median_strain is not None
    if not median_strain > 0.0:
        raise InputError("noise.percent_of_median_strain: the median strain is 0; give std_um_per_m")
    return (0.01 * entry.percent_of_median_strain * median_strain) ** 2 * np.eye(n_gauges)


MATRIX = 256 * MIB
"""Covariance of 2,000 gauges with all digits: 100 MiB."""


def _covariance_of(path: Path, n_gauges: int) -> FloatArray:
    """Read a square CSV table of numbers and check that it is a covariance."""
    where = f"noise.covariance_file: {path}"
    rows = [row for row in _rows(path, "noise.covariance_file", MATRIX) if not row[0].startswith("#")]
    try:
        values = np.array([[float(cell) for cell in row] for row in rows]).reshape(max(len(rows), 1), -1)
    except ValueError as error:
        raise InputError(f"{where}: not a table of numbers separated by commas") from error
    if values.shape != (n_gauges, n_gauges):
        raise InputError(f"{where}: {values.shape[0]} x {values.shape[1]} found, must be {n_gauges} x {n_gauges}")
    symmetric = np.all(np.isfinite(values)) and np.allclose(values, values.T, rtol=1e-9, atol=0.0)
    if not (symmetric and np.linalg.eigvalsh(values)[0] > 0.0):
        raise InputError(f"{where}: no covariance: must be symmetric and positive definite")
    return values


def _rows(path: Path, entry: str, largest: int) -> list[list[str]]:
    try:
        return [row for _, row in read_csv(path, largest)]
    except InputError as error:
        raise InputError(f"{entry}: {error}") from error


def nuisance_terms(path: Path, gauge_names: Sequence[str]) -> list[NoiseTerm]:
    """Read further modes of strain error from a CSV file: one term per column, with the column's name.

    The header is ``gauge`` and a name per mode. A row is a gauge's name and its strain [um/m] in each mode at one
    standard deviation. Rows may be in any order.

    Raises
    ------
    InputError
        The file is missing, holds other gauges than ``gauge_names``, or a value is no number; the message names
        the gauge.
    """
    where = f"noise.nuisance_file: {path}"
    header, *rows = _rows(path, "noise.nuisance_file", LARGEST) or [[]]
    names = [name.strip() for name in header[1:]]
    if len(header) < 2 or header[0].strip() != "gauge" or "" in names or len(set(names)) < len(names):
        got = shown_columns(header, ("gauge",))
        raise InputError(f"{where}: expected the columns gauge and a name per mode, got {got}")
    terms = dict(_nuisance_row(row, len(names), where) for row in rows)
    if len(terms) < len(rows):
        raise InputError(f"{where}: a gauge is listed twice")
    for name in gauge_names:
        if name not in terms:
            raise InputError(f"{where}: gauge '{name}' of the layout in use is missing")
    if len(terms) > len(gauge_names):
        unknown = next(name for name in terms if name not in gauge_names)
        raise InputError(f"{where}: gauge '{unknown}' is not in the layout in use")
    strain = MICRO * np.array([terms[name] for name in gauge_names])
    return [nuisance_modes(name, strain[:, [k]], np.ones(1)) for k, name in enumerate(names)]


def _nuisance_row(row: list[str], n_modes: int, where: str) -> tuple[str, list[float]]:
    """Return the gauge's name and its values."""
    name = row[0].strip()
    if len(row) != n_modes + 1:
        raise InputError(f"{where}, gauge '{name}': {len(row) - 1} values found, must be {n_modes}")
    try:
        values = [float(value) for value in row[1:]]
    except ValueError as error:
        raise InputError(f"{where}, gauge '{name}': {', '.join(row[1:])} found, must be numbers") from error
    if not np.all(np.isfinite(values)):
        raise InputError(f"{where}, gauge '{name}': {', '.join(row[1:])} found, must be finite")
    return name, values
