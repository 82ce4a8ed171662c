"""Circumferential amplitudes of the snapshots' pressure over Mach number and total incidence."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from builder.campaign.snapshots import Snapshots
from builder.vehicle.flight_conditions import flow_key
from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError

MAX_HARMONIC = 16
"""Highest circumferential harmonic of the pressure in the tables; the gauges see those up to about 8."""


@dataclass(frozen=True, eq=False, kw_only=True)
class FlowAmplitudes:
    """Flows at a grid of Mach numbers and total incidences.

    Attributes
    ----------
    mach : (n_M,) increasing [1].
    incidence : (n_a,) total incidence, increasing [rad].
    amplitude : (n_M, n_a, n_x, n_m) of cos m(phi - phi_T) in p / p_inf [1].
    of_two : whether the middle one of three Mach numbers is not solved but by :func:`with_middle_mach`.
    """

    mach: FloatArray
    incidence: FloatArray
    amplitude: FloatArray
    of_two: bool = False

    def overpressure(self) -> FloatArray:
        """Return (n_x,) p / p_inf - 1 round the body at the smallest incidence, its mean over the Mach numbers."""
        return np.asarray(self.amplitude[:, 0, :, 0].mean(axis=0) - 1.0)

    def less_ambient(self) -> FlowAmplitudes:
        """Return the amplitudes of p / p_inf - 1, what loads a body whose internal pressure is ambient."""
        amplitude = self.amplitude.copy()
        amplitude[..., 0] -= 1.0
        return replace(self, amplitude=amplitude)

    def with_middle_mach(self) -> FlowAmplitudes:
        """Return the flows at two Mach numbers, and those between them by :func:`with_middle_mach`."""
        mach, amplitude = with_middle_mach(self.mach, self.less_ambient().amplitude)
        amplitude[..., 0] += 1.0
        return replace(self, mach=mach, amplitude=amplitude, of_two=True)


def flow_amplitudes(snapshots: Snapshots, max_harmonic: int = MAX_HARMONIC) -> FlowAmplitudes:
    """Return the amplitudes, up to ``max_harmonic``, of every distinct flow of ``snapshots``.

    Of two Mach numbers the amplitudes of the one between are added, see :func:`with_middle_mach`.

    Raises
    ------
    InputError
        The surface has no rings, or there are incidences at one Mach number that are not at another.
    """
    grid = snapshots.grid
    if grid is None:
        raise InputError("nonlinear estimator: expected snapshots of a body of revolution, got a free surface")
    conditions = snapshots.conditions()
    first: dict[tuple[float, ...], int] = {}
    for row, condition in enumerate(conditions):
        first.setdefault(tuple(np.round(flow_key(condition), 6)), row)
    mach, incidence = (np.array(sorted({key[axis] for key in first})) for axis in (0, 1))
    n_m = min(max_harmonic, (grid.n_roll - 1) // 2) + 1
    amplitude = np.empty((len(mach), len(incidence), len(grid.x), n_m))
    for i, one_mach in enumerate(mach):
        for j, one_incidence in enumerate(incidence):
            key = (one_mach, one_incidence)
            if key not in first:
                raise InputError(
                    f"nonlinear estimator: no flow at Mach number {one_mach:g} and total incidence "
                    f"{np.degrees(one_incidence):.4g} deg; every incidence must be there at every Mach number"
                )
            condition = conditions[first[key]]
            rings = (snapshots.pressure[first[key]] / condition.ambient_pressure).reshape(len(grid.x), -1)
            amplitude[i, j] = cosine_amplitudes(rings, grid.roll_angle - condition.leeward_roll_angle, n_m)
    flows = FlowAmplitudes(mach=mach, incidence=incidence, amplitude=amplitude)
    return flows.with_middle_mach() if len(mach) == 2 else flows


def with_middle_mach(mach: FloatArray, values: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return two Mach numbers with the one between, and the values (3, ...) per p_inf there.

    Between them what p - p_inf strains is linear per unit of dynamic pressure.
    """
    middle, square = mach.mean(), mach.reshape(-1, *[1] * (values.ndim - 1)) ** 2
    between = middle**2 * np.mean(values / square, axis=0)
    return np.array([mach[0], middle, mach[1]]), np.stack([values[0], between, values[1]])


def cosine_amplitudes(rings: FloatArray, angle: FloatArray, n_m: int) -> FloatArray:
    """Return (n_x, n_m) amplitudes of cos(m angle) in ``rings`` (n_x, n_roll), evenly spaced round the body."""
    weight = np.where(np.arange(n_m) == 0, 1.0, 2.0) / len(angle)
    return np.asarray(rings @ np.cos(np.outer(angle, np.arange(n_m))) * weight)
