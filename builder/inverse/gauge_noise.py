"""The gauges' own noise and their errors, from the entries of a vehicle file."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from builder.inverse.gauge_derivatives import GaugeDerivatives
from builder.inverse.noise_model import NoiseTerm, gauge_errors, nuisance_modes
from builder.map_options import Noise
from strainfmu.errors import InputError

FloatArray = NDArray[np.float64]

MICRO = 1e-6


def gauge_covariance(entry: Noise, n_gauges: int, median_strain: float, folder: Path) -> FloatArray:
    """Return the covariance (n_gauges, n_gauges) of the gauges' own noise [(m/m)^2].

    Parameters
    ----------
    entry : section [noise].
    n_gauges : n_d.
    median_strain : median |strain| that a relative noise refers to [m/m].
    folder : where ``covariance_file`` lies.

    Raises
    ------
    InputError
        The number of values is not that of the gauges, or a file is no covariance.
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


def _covariance_of(path: Path, n_gauges: int) -> FloatArray:
    """Read a square CSV table of numbers and check that it is a covariance."""
    where = f"noise.covariance_file: {path}"
    try:
        values = np.loadtxt(path, delimiter=",", ndmin=2)
    except OSError as error:
        raise InputError(f"{where}: cannot be read: {error.strerror or 'no such file'}") from error
    except ValueError as error:
        raise InputError(f"{where}: not a table of numbers separated by commas") from error
    if values.shape != (n_gauges, n_gauges):
        raise InputError(f"{where}: {values.shape[0]} x {values.shape[1]} found, must be {n_gauges} x {n_gauges}")
    symmetric = np.all(np.isfinite(values)) and np.allclose(values, values.T, rtol=1e-9, atol=0.0)
    if not (symmetric and np.linalg.eigvalsh(values)[0] > 0.0):
        raise InputError(f"{where}: no covariance: must be symmetric and positive definite")
    return values


def gauge_error_terms(
    entry: Noise, net_pressure: FloatArray, strain_operator: FloatArray, derivatives: GaugeDerivatives | None
) -> list[NoiseTerm]:
    """Return the terms that ``entry`` adds for apparent strain and for the gauges' gain, position and orientation.

    Parameters
    ----------
    entry : section [noise].
    net_pressure : (N, n_p) p - p_internal of the snapshots [Pa], over which errors are averaged.
    strain_operator : (n_d, n_p) Z_p [1/Pa].
    derivatives : of Z_p, needed for position and orientation errors.

    Raises
    ------
    InputError
        Position or orientation errors are asked for and there are no derivatives.
    """
    terms = []
    if entry.apparent_strain_um_per_m > 0.0:
        column = np.ones((len(strain_operator), 1))
        terms.append(nuisance_modes("apparent strain", column, np.array([MICRO * entry.apparent_strain_um_per_m])))
    if entry.gauge_gain_percent > 0.0:
        terms.append(gauge_errors("gauge gain", net_pressure @ strain_operator.T, 0.01 * entry.gauge_gain_percent))
    for name, std in (
        ("gauge_position_mm", entry.gauge_position_mm),
        ("gauge_orientation_deg", entry.gauge_orientation_deg),
    ):
        if std > 0.0 and derivatives is None:
            raise InputError(f"noise.{name}: {std:g} found, needs structure.model = 'fourier'")
    if derivatives is not None:
        position, angle = 1e-3 * entry.gauge_position_mm, np.deg2rad(entry.gauge_orientation_deg)
        for name, derivative, std in (
            ("gauge position, axial", derivatives.axial, position),
            ("gauge position, circumferential", derivatives.circumferential, position),
            ("gauge orientation", derivatives.orientation, float(angle)),
        ):
            if std > 0.0:
                terms.append(gauge_errors(name, net_pressure @ derivative.T, std))
    return terms
