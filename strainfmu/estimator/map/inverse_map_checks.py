"""What a map must be: shapes and values."""

from __future__ import annotations

from typing import Any

import numpy as np

from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError
from strainfmu.estimator.air_inputs import DYNAMIC_PRESSURE
from strainfmu.estimator.numerics.fixed_order import row_squares
from strainfmu.estimator.other_loads import FIVE_LOADS, number_of
from strainfmu.estimator.setting_inputs import OF_AREA, OF_LENGTH

CASES = (1, 2)
"""Least squares on POD modes; low-rank Gaussian prior."""

FORMS = PER_PRESSURE, ABSOLUTE = (DYNAMIC_PRESSURE, "absolute")
"""Strain in proportion to q_inf, for any altitude; the paper's, for the pressure level of the snapshots."""

_ROUND_OFF = 1e-6
"""Largest relative difference between numbers that are equal but for round-off."""


GROUPS = (("gauge_error_product", "common_error", "mean_product"), ("fixed_strain", "fixed_load"))
"""Fields that a map has all of, or none."""

FIELD = ("field_mean", "field_modes", "point", "triangle")
"""The same of the pressure on the surface."""


def check_inverse_map(inverse_map: Any) -> None:
    """Check a map whose groups and arrays are checked.

    Raises
    ------
    InputError
        A part is missing, or has another shape or value than it must have.
    """
    _check_field(inverse_map)
    _check_values(inverse_map)
    _check_form(inverse_map)
    _check_parts(inverse_map)
    _check_covariance(inverse_map)


def _check_parts(inverse_map: Any) -> None:
    """Check that sensors, temperature modes and tables are of the map's gauges."""
    n_d, manifold, inertia = inverse_map.n_gauges, inverse_map.manifold, inverse_map.inertia
    counts = [
        ("sensors", "rows", len(inverse_map.sensors.kind), n_d),
        ("inertia", "gauges", n_d if inertia is None else len(inertia.mode_strain), n_d),
        ("thermal", "gauges", len(inverse_map.thermal.mode_strain), n_d),
    ]
    if manifold is not None:
        n_sensors = n_d - inverse_map.n_strain_gauges
        counts += [
            ("tables", "gauges", manifold.n_gauges, n_d),
            ("tables", "loads", manifold.n_loads, inverse_map.n_loads),
            ("tables", "auxiliary sensors", manifold.n_sensors, n_sensors),
        ]
    for part, what, count, wanted in counts:
        if count != wanted:
            raise InputError(
                f"inverse map: {part} of {count} {what}, must be {'' if what == 'rows' else 'of '}{wanted}"
            )


def check_number_of_loads(inverse_map: Any) -> None:
    """Check that the loads are the five, or these with the loads of every group.

    Raises
    ------
    InputError
        They are others.
    """
    groups, found = inverse_map.load_groups, inverse_map.load_of_mean.size
    sizes = {group.family: group.size for group in groups if group.family.is_listed}
    allowed = FIVE_LOADS.stop + number_of(groups)
    if found != allowed and (sizes or found != FIVE_LOADS.stop):
        counts = ", ".join(f"{size} {family.singular}s" for family, size in sizes.items())
        allowed_text = f"{allowed} for {counts}" if sizes else f"{FIVE_LOADS.stop} or {allowed}"
        raise InputError(f"inverse map: load_of_mean has {found} loads, must be {allowed_text}")


def check_groups(inverse_map: Any) -> None:
    """Check that fields which belong together are all given or all absent.

    Raises
    ------
    InputError
        Some are missing.
    """
    for names in GROUPS:
        stated = [name for name in names if getattr(inverse_map, name).shape != (0,)]
        if stated and len(stated) < len(names):
            raise InputError(f"inverse map: {', '.join(stated)} of {', '.join(names)} found, must be all or none")
    missing = [name for name in FIELD if not getattr(inverse_map, name).size]
    if missing and len(missing) < len(FIELD):
        raise InputError(f"inverse map: {', '.join(missing)} missing, the pressure field needs {', '.join(FIELD)}")


def _check_form(inverse_map: Any) -> None:
    """Check the form, and the numbers that go with it."""
    if inverse_map.form not in FORMS:
        raise InputError(f"inverse map: form is '{inverse_map.form}', must be one of {', '.join(FORMS)}")
    if inverse_map.follows_pressure and inverse_map.regularisation not in (0.0, 1.0):
        raise InputError(
            f"inverse map: regularisation is {inverse_map.regularisation}, must be 1 (0 in Case 1) in form "
            "'dynamic_pressure'"
        )
    if inverse_map.errors_follow_strain and not inverse_map.mean_product.any():
        raise InputError(
            "inverse map: mean_product is 0, must be given where gauge_error_product or common_error is not 0"
        )
    for name in ("chi_square_scale", "outlier_scale", "envelope_score_limit"):
        if not 0.0 < getattr(inverse_map, name) < np.inf:
            raise InputError(f"inverse map: {name} is {getattr(inverse_map, name)}, must be positive")
    if not 0.0 <= inverse_map.level_slope <= 1.0:
        raise InputError(f"inverse map: level_slope is {inverse_map.level_slope}, must be 0 to 1")
    if not 0.0 <= inverse_map.dynamic_pressure_error < 1.0:
        raise InputError(
            f"inverse map: dynamic_pressure_error is {inverse_map.dynamic_pressure_error}, must be 0 to 1"
        )


def _check_field(inverse_map: Any) -> None:
    """Check the pressure field, whose shapes are checked."""
    n_p, triangle = len(inverse_map.field_mean), inverse_map.triangle
    if not np.all(inverse_map.field_std >= 0.0):
        raise InputError("inverse map: field_std must be at least 0")
    of_flight = None if inverse_map.manifold is None else inverse_map.manifold.surface_field
    if of_flight is not None and inverse_map.has_field and of_flight.n_nodes != n_p:
        raise InputError(f"inverse map: pressure_field has {of_flight.n_nodes} nodes, must have {n_p}")
    if len(triangle) and not (triangle.min() >= 0 and triangle.max() < n_p):
        raise InputError(f"inverse map: triangle names nodes outside 0 .. {n_p - 1}")


def _check_values(inverse_map: Any) -> None:
    """Check what must be positive, named once, or one of a few."""
    for name in (OF_AREA, OF_LENGTH, "nominal_dynamic_pressure"):
        if not 0.0 < getattr(inverse_map, name) < np.inf:
            raise InputError(f"inverse map: {name} is {getattr(inverse_map, name)}, must be positive")
    n_d, n_q = len(inverse_map.gauge_names), inverse_map.n_states
    if len(set(inverse_map.gauge_names)) != n_d or n_d == 0:
        raise InputError("inverse map: gauge_names must hold at least one name and none twice")
    if not np.all(inverse_map.noise_std > 0.0):
        raise InputError("inverse map: noise_std must be positive")
    if inverse_map.case not in CASES:
        raise InputError(f"inverse map: case is {inverse_map.case}, must be one of {', '.join(map(str, CASES))}")
    gamma, free = inverse_map.regularisation, inverse_map.case == 1
    if not (gamma == 0.0 if free else 0.0 < gamma < np.inf):
        allowed = "0" if free else "positive"
        raise InputError(f"inverse map: regularisation is {gamma}, must be {allowed} in Case {inverse_map.case}")
    if free and n_d <= n_q:
        raise InputError(f"inverse map: {n_d} gauges for {n_q} states found, health needs at least one gauge more")


def _check_covariance(inverse_map: Any) -> None:
    """Check that Gamma_g is a covariance, Gamma holds the gauges' noise, and gauges identify the states."""
    try:
        check_covariance(inverse_map.gauge_covariance)
        total = np.diag(inverse_map.gauge_covariance) + row_squares(inverse_map.error_strain)
        if not np.all(total >= (1.0 - _ROUND_OFF) * inverse_map.noise_std**2):
            raise InputError("gauge_covariance has variances below noise_std squared, must hold the gauge noise")
        if inverse_map.case == 1:
            _check_rank(inverse_map.state_operator, inverse_map.noise_std)
    except InputError as error:
        raise InputError(f"inverse map: {error}") from error


def _check_rank(state_operator: FloatArray, noise_std: FloatArray) -> None:
    """Check that the strains of the states, (n_d, n_q) over the gauges' noise, are independent."""
    whitened = state_operator / noise_std[:, None]
    size = np.linalg.norm(whitened, axis=0)
    if not (np.all(size > 0.0) and np.linalg.matrix_rank(whitened / size) == len(size)):
        raise InputError("state_operator does not identify the states: its columns are dependent")


def check_covariance(covariance: FloatArray) -> None:
    """Check that ``covariance`` (n_d, n_d) of gauges is one.

    Raises
    ------
    InputError
        The matrix is not symmetric positive definite.
    """
    try:
        variance = np.diag(covariance)
        if not (np.all(variance > 0.0) and np.allclose(covariance, covariance.T, rtol=1e-9, atol=0.0)):
            raise np.linalg.LinAlgError
        std = np.sqrt(variance)  # gauges of unlike noise cost no digits
        np.linalg.cholesky(covariance / np.outer(std, std))
    except np.linalg.LinAlgError as error:
        raise InputError("noise_covariance must be symmetric and positive definite") from error
