"""Strain from the output of a Wheatstone bridge.

Arms of resistance R, gauges of gauge factor k, output V over excitation V_ex, r = (V - V_0)/V_ex, positive in
tension: the change x = dR/R of an active arm follows from the divider rule, strain = x/k. With r of the
other sign these are the formulas of National Instruments, NI-DAQmx, "Strain Gage Configurations".

    quarter               r = x/(4 + 2 x)                          x = 4 r/(1 - 2 r)
    half-poisson          r = x (1 + nu)/(4 + 2 x (1 - nu))        x = 4 r/((1 + nu) - 2 r (1 - nu))
    half-bending          r = x/2                                  x = 2 r
    full-bending          r = x                                    x = r
    full-bending-poisson  r = x (1 + nu)/2                         x = 2 r/(1 + nu)
    full-poisson          r = x (1 + nu)/(2 + x (1 - nu))          x = 2 r/((1 + nu) - r (1 - nu))
"""

from __future__ import annotations

from collections.abc import Callable

from strainfmu.arrays import FloatArray

_CHANGE: dict[str, Callable[[FloatArray, float], FloatArray]] = {
    "quarter": lambda r, nu: 4.0 * r / (1.0 - 2.0 * r),
    "half-poisson": lambda r, nu: 4.0 * r / ((1.0 + nu) - 2.0 * r * (1.0 - nu)),
    "half-bending": lambda r, nu: 2.0 * r,
    "full-bending": lambda r, nu: r,
    "full-bending-poisson": lambda r, nu: 2.0 * r / (1.0 + nu),
    "full-poisson": lambda r, nu: 2.0 * r / ((1.0 + nu) - r * (1.0 - nu)),
}

BRIDGES = tuple(_CHANGE)

BENDING = ("half-bending", "full-bending", "full-bending-poisson")
"""Bridges whose output is half the difference of the strains at two positions."""

POISSON = ("half-poisson", "full-poisson", "full-bending-poisson")
"""Bridges that take the strain across for -nu times that along: true under uniaxial stress alone."""

WIRES = {
    "quarter": (2, 3),
    "half-poisson": (3,),
    "half-bending": (3,),
    **dict.fromkeys(("full-bending", "full-bending-poisson", "full-poisson"), (4, 6)),
}
"""Numbers of lead wires that a bridge may have."""

_LEADS = {2: 2.0, 3: 1.0, 4: 2.0, 6: 0.0}
"""Lead resistances in series with an arm, or with the whole bridge, of the resistance of a gauge each."""


def bridge_strain(ratio: FloatArray, bridge: str, gauge_factor: float, poisson_ratio: float) -> FloatArray:
    """Return (n,) strain [m/m] of output over excitation (n,) [V/V], positive in tension."""
    return _CHANGE[bridge](ratio, poisson_ratio) / gauge_factor


def lead_factor(wires: int, lead_resistance: float, gauge_resistance: float) -> float:
    """Return the factor that makes up for the resistance of the leads [1].

    Two wires: both leads stand in the arm of the gauge, 1 + 2 R_L/R_G. Three: one does, 1 + R_L/R_G. Four of a
    full bridge: both leads of the excitation lower its voltage, 1 + 2 R_L/R_G. Six, with sense wires: 1.

    Parameters
    ----------
    lead_resistance : R_L of one lead [ohm].
    gauge_resistance : R_G [ohm].
    """
    return 1.0 + _LEADS[wires] * lead_resistance / gauge_resistance
