"""Errors of the vehicle and its gauges as built: as terms of the weights, and as functions of the current strain.

Every error has an operator that gives its strain, per standard deviation, from the surface pressure: the
derivative of Z_p of the vehicle as built by the error, times the size that [noise] states. The kinds are
listed in :mod:`builder.structure.as_built_kinds`.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from builder.inverse.modes.ensemble import Ensemble
from builder.inverse.noise.gauge_derivatives import counts_of_layout, strain_derivatives
from builder.inverse.noise.model import NoiseTerm, common_error, gauge_errors, nuisance_modes
from builder.structure.as_built.as_built_vehicle import stated_keys
from builder.structure.as_built_kinds import KINDS
from builder.structure.fourier.fourier_model import StructuralModel
from builder.structure.mapped_structure import MappedStructure
from builder.vehicle.file import Vehicle
from strainfmu.arrays import FloatArray
from strainfmu.estimator.map.inverse_map import PAIRS


@dataclass(frozen=True, eq=False, kw_only=True)
class HardwareError:
    """One error in proportion to strain.

    Attributes
    ----------
    name : for reports.
    operator : (n_d, n_p) strain per pressure at one standard deviation [1/Pa].
    strain : (n, n_d) its strain at the members of the ensemble [m/m].
    common : whether all gauges have the same error, or each its own.
    of_mesh : whether it is an error of the structure's mesh, not of the hardware.
    with_rest : whether the nonlinear estimator counts, gauge by gauge, what no load follows of a common error.
    """

    name: str
    operator: FloatArray
    strain: FloatArray
    common: bool
    of_mesh: bool = False
    with_rest: bool = False


def hardware_errors(
    vehicle: Vehicle,
    structure: StructuralModel | MappedStructure,
    strain_operator: FloatArray,
    ensemble: Ensemble,
    modulus_std: float = 0.0,
) -> list[HardwareError]:
    """Return the errors of the section [noise] that are in proportion to strain; errors of size 0 are left out.

    ``strain_operator`` is Z_p (n_d, n_p) [1/Pa] of the layout in use, ``modulus_std`` the relative error of
    Young's modulus by the wall's temperature.

    Raises
    ------
    InputError
        A gauge lies within a step of the end of its surface, or the structure holds no displaced gauges.
    """
    entry, layout = vehicle.noise, vehicle.gauges.layout
    keys = stated_keys(entry, counts_of_layout(vehicle, structure, layout))
    derivative = strain_derivatives(vehicle, structure, layout, keys)
    operators = [(KINDS[key[0]], KINDS[key[0]].std(entry) * derivative[key]) for key in keys]
    columns = [(kind.column_name, operator, kind.extent != "gauge") for kind, operator in operators]
    gain = sum(kind.name in ("gauge_gain", "common_gain") for kind, _ in operators)
    columns.insert(gain, ("modulus with temperature", modulus_std * strain_operator, True))
    # Errors of each gauge first.
    named = sorted((column for column in columns if np.any(column[1])), key=lambda column: column[2])
    if not named:
        return []
    strain = ensemble.responses(np.concatenate([operator for _, operator, _ in named]))
    parts = np.split(strain, len(named), axis=1)
    return [
        HardwareError(name=name, operator=operator, strain=part, common=common)
        for (name, operator, common), part in zip(named, parts, strict=True)
    ]


def hardware_terms(
    vehicle: Vehicle, errors: list[HardwareError], ensemble: Ensemble, strain_operator: FloatArray
) -> list[NoiseTerm]:
    """Return the noise terms of ``errors``, averaged over the ensemble, and of those that do not follow strain."""
    entry, terms = vehicle.noise, error_terms(errors, ensemble)
    if entry.apparent_strain_um_per_m > 0.0:
        column, std = np.ones((len(strain_operator), 1)), np.array([KINDS["apparent_strain"].std(entry)])
        terms.append(replace(nuisance_modes("apparent strain", column, std), hardware=True))
    if entry.internal_pressure_percent > 0.0:
        rms = rms_ambient_pressure(ensemble)
        column = strain_operator.sum(axis=1)[:, None]
        std = np.array([KINDS["internal_pressure"].std(entry) * rms])
        terms.append(replace(nuisance_modes("internal pressure", column, std), hardware=True, scales=True))
    return terms


def error_terms(errors: list[HardwareError], ensemble: Ensemble) -> list[NoiseTerm]:
    """Return the noise terms of ``errors``, averaged over the ensemble; errors of one name are one term."""
    terms: dict[str, NoiseTerm] = {}
    for error in errors:
        term = common_error if error.common else gauge_errors
        error_term = term(error.name, error.strain, 1.0, ensemble.member_weight)
        if error.name in terms:
            error_term = replace(error_term, strain=np.hstack([terms[error.name].columns, error_term.columns]))
        terms[error.name] = replace(error_term, hardware=not error.of_mesh)
    return list(terms.values())


def rms_ambient_pressure(ensemble: Ensemble) -> float:
    """Return the root mean square of p_inf over the flows [Pa]."""
    return float(np.sqrt(np.average(ensemble.ambient_pressure**2, weights=ensemble.weight)))


def error_model(
    errors: list[HardwareError], ensemble: Ensemble, coefficients: FloatArray
) -> dict[str, FloatArray]:
    """Return fields of a map: how ``errors`` follow the coefficients (n, 5) of the members; none without errors.

    The strain of an error is regressed on [1, C] over the members. What the regression leaves stays in the
    weights.
    """
    if not errors:
        return {}
    weight = ensemble.member_weight
    c = np.hstack([np.ones((len(coefficients), 1)), coefficients])
    root = np.sqrt(weight)[:, None]
    n_d = len(errors[0].operator)
    of_gauge, common = np.zeros((len(PAIRS), n_d)), []
    for error in errors:
        slope = np.linalg.lstsq(root * c, root * error.strain, rcond=1e-10)[0]
        if error.common:
            common.append(slope)
            continue
        for row, (a, b) in enumerate(PAIRS):
            of_gauge[row] += (1.0 if a == b else 2.0) * slope[a] * slope[b]
    return {
        "gauge_error_product": of_gauge,
        "common_error": np.array(common).reshape(-1, 6, n_d),
        "mean_product": np.array([weight @ (c[:, a] * c[:, b]) for a, b in PAIRS]),
    }
