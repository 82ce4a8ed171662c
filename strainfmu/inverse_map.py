"""The artefact ``map.h5``: everything that turns strain into loads, and what it was made from.

The estimate of the pressure state is q = T d + k (paper, eq. segmented-ls-solution, with the mean's
strain in k) and the loads are f = (G C_map V_r) q + G C_map p_mean. Both are affine, so the run-time
needs their product only; T, k and the load rows stay in the file for whoever wants the state.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from strainfmu.errors import InputError
from strainfmu.records import load_record, save_record

FloatArray = NDArray[np.float64]

SCHEMA = "strainfmu.inverse_map"
SCHEMA_VERSION = 1

LOAD_NAMES = ("axial_force", "normal_force", "side_force", "pitching_moment", "yawing_moment")
COEFFICIENT_NAMES = ("C_A", "C_N", "C_Y", "M_P", "M_Y")

_UNITS = {
    "gauge_position": "m",
    "gauge_direction": "1",
    "noise_std": "m/m",
    "strain_gain": "Pa/(m/m)",
    "state_offset": "Pa",
    "load_per_state": "N/Pa, N.m/Pa",
    "load_of_mean": "N, N.m",
    "load_covariance": "(N, N.m)^2",
    "mean_strain": "m/m",
    "residual_whitening": "1/(m/m)",
    "strain_range": "m/m",
    "coefficient_range": "1",
    "reference_area": "m2",
    "reference_length": "m",
    "nominal_dynamic_pressure": "Pa",
}


@dataclass(frozen=True)
class InverseMap:
    """A finished inverse map for n_d gauges and n_q pressure states.

    Loads are ordered as :data:`LOAD_NAMES` [N, N, N, N m, N m], coefficients as :data:`COEFFICIENT_NAMES`.

    Attributes
    ----------
    vehicle : name of the vehicle and what it stands for.
    gauge_names : n_d names, unique.
    gauge_position : (n_d, 3) position in body axes [m].
    gauge_direction : (n_d, 3) unit vectors of the measured strain.
    noise_std : (n_d,) standard deviation sigma of each gauge's noise [m/m].
    strain_gain : (n_q, n_d) T [Pa/(m/m)].
    state_offset : (n_q,) k [Pa].
    load_per_state : (5, n_q) G C_map V_r [N/Pa, N m/Pa].
    load_of_mean : (5,) loads of the mean pressure [N, N m].
    load_covariance : (5, 5) covariance of the estimated loads [(N, N m)^2].
    mean_strain : (n_d,) strain of the mean pressure [m/m].
    residual_whitening : (n_d, n_d) W; chi-square of strain d is |W (d - mean_strain)|^2.
    residual_degrees_of_freedom : expected value of that chi-square.
    strain_range : (n_d,) largest |strain| over the snapshots [m/m].
    coefficient_range : (5, 2) smallest and largest coefficient over the snapshots.
    reference_area : S [m2].
    reference_length : L [m].
    nominal_dynamic_pressure : mean q_inf of the snapshots [Pa].
    provenance : what the map was built from: settings, versions, hashes, the flight envelope.
    """

    vehicle: str
    gauge_names: tuple[str, ...]
    gauge_position: FloatArray
    gauge_direction: FloatArray
    noise_std: FloatArray
    strain_gain: FloatArray
    state_offset: FloatArray
    load_per_state: FloatArray
    load_of_mean: FloatArray
    load_covariance: FloatArray
    mean_strain: FloatArray
    residual_whitening: FloatArray
    residual_degrees_of_freedom: int
    strain_range: FloatArray
    coefficient_range: FloatArray
    reference_area: float
    reference_length: float
    nominal_dynamic_pressure: float
    provenance: dict[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        n_d, n_q = len(self.gauge_names), len(self.state_offset)
        expected = {
            "gauge_position": (n_d, 3),
            "gauge_direction": (n_d, 3),
            "noise_std": (n_d,),
            "strain_gain": (n_q, n_d),
            "state_offset": (n_q,),
            "load_per_state": (5, n_q),
            "load_of_mean": (5,),
            "load_covariance": (5, 5),
            "mean_strain": (n_d,),
            "residual_whitening": (n_d, n_d),
            "strain_range": (n_d,),
            "coefficient_range": (5, 2),
        }
        for name, shape in expected.items():
            value = getattr(self, name)
            if value.shape != shape:
                raise InputError(f"inverse map: {name} has shape {value.shape}, must be {shape}")
            if not np.all(np.isfinite(value)):
                raise InputError(f"inverse map: {name} holds values that are not finite")
        for name in ("reference_area", "reference_length", "nominal_dynamic_pressure"):
            if not 0.0 < getattr(self, name) < np.inf:
                raise InputError(f"inverse map: {name} is {getattr(self, name)}, must be positive")
        if len(set(self.gauge_names)) != n_d or n_d == 0:
            raise InputError("inverse map: gauge_names must hold at least one name and none twice")
        if not np.all(self.noise_std > 0.0):
            raise InputError("inverse map: noise_std must be positive")
        if not np.all(np.diag(self.load_covariance) > 0.0):
            raise InputError("inverse map: load_covariance must have positive variances")
        if self.residual_degrees_of_freedom < 1:
            raise InputError(
                f"inverse map: {n_d} gauges for {n_q} states found, health needs at least one gauge more"
            )

    @property
    def n_gauges(self) -> int:
        """Number of gauges n_d."""
        return len(self.gauge_names)


def save_inverse_map(inverse_map: InverseMap, path: Path) -> str:
    """Write ``inverse_map`` to ``path`` atomically and return its content hash.

    Raises
    ------
    StrainfmuError
        The file could not be written; what was there before is untouched.
    """
    return save_record(inverse_map, path, SCHEMA, SCHEMA_VERSION, _UNITS)


def load_inverse_map(path: Path) -> InverseMap:
    """Read and check a map.

    Raises
    ------
    InputError
        The file is missing, damaged, altered, or of another schema version.
    """
    return load_record(InverseMap, path, SCHEMA, SCHEMA_VERSION)
