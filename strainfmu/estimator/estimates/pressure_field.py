"""Pressure on the surface with its standard deviation."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError


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


def unknown_field(n_nodes: int, is_net: bool) -> PressureField:
    """Return the pressure of a sample without an estimate: NaN at all ``n_nodes``."""
    return PressureField(pressure=np.full(n_nodes, np.nan), std=np.full(n_nodes, np.nan), is_net=is_net)


def no_field() -> InputError:
    """Return the error of a map without a pressure field."""
    return InputError("inverse map: holds no pressure field, expected one built with keep_field = true in [map]")
