"""Pressure on the surface with its standard deviation, and what it follows from in addition to an estimate."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from strainfmu.arrays import FloatArray
from strainfmu.estimator.map.inverse_map import InverseMap


@dataclass(frozen=True, eq=False, kw_only=True)
class PressureField:
    """Pressure at the n_p nodes of a map, ``point`` and ``triangle`` of the map.

    Attributes
    ----------
    pressure : (n_p,) [Pa]; NaN where the estimate holds no loads.
    std : (n_p,) standard deviation of each node [Pa].
    is_net : whether ``pressure`` is p - p_inf, as of a linear map whose internal pressure is the ambient one.
    """

    pressure: FloatArray
    std: FloatArray
    is_net: bool


@dataclass(frozen=True, eq=False, kw_only=True)
class FieldInputs:
    """What the pressure of k samples, or of one, follows from in addition to their estimates.

    Attributes
    ----------
    inverse_map : the map that the estimates are of.
    strain : (k, n_d) [m/m].
    dynamic_pressure, dynamic_pressure_std : (k,) q_inf and its standard deviation [Pa], NaN where not known.
    static_pressure, static_pressure_std : the same of p_inf by navigation.
    parameter_value, parameter_std : (k, n_p) of what is known of flow parameters with a standard deviation,
        NaN of all else.
    """

    inverse_map: InverseMap
    strain: FloatArray
    dynamic_pressure: FloatArray
    dynamic_pressure_std: FloatArray
    static_pressure: FloatArray
    static_pressure_std: FloatArray
    parameter_value: FloatArray
    parameter_std: FloatArray

    def of_sample(self, sample: int) -> FieldInputs:
        """Return the inputs of one sample, arrays without the axis of the samples."""
        return FieldInputs(
            inverse_map=self.inverse_map,
            strain=self.strain[sample],
            dynamic_pressure=self.dynamic_pressure[sample],
            dynamic_pressure_std=self.dynamic_pressure_std[sample],
            static_pressure=self.static_pressure[sample],
            static_pressure_std=self.static_pressure_std[sample],
            parameter_value=self.parameter_value[sample],
            parameter_std=self.parameter_std[sample],
        )


def unknown_field(n_nodes: int, is_net: bool) -> PressureField:
    """Return the pressure of a sample without an estimate: NaN at all ``n_nodes``."""
    return PressureField(pressure=np.full(n_nodes, np.nan), std=np.full(n_nodes, np.nan), is_net=is_net)
