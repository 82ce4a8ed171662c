"""The row of one sensor other than the strain gauges: reading per surface pressure, noise, errors."""

from __future__ import annotations

from dataclasses import dataclass, field

from strainfmu.arrays import FloatArray


@dataclass(frozen=True, eq=False, kw_only=True)
class SensorRow:
    """One sensor.

    Attributes
    ----------
    name, kind, unit : of the reading.
    position, direction : (3,) [m], (3,) in body axes.
    operator : (n_p,) reading per net surface pressure [unit/Pa].
    std, largest, gain : standard deviation of its noise [unit], largest reading [unit], error over reading [1].
    per_axial_force : reading per axial force on the body, as of base pressure [unit/N].
    follows_inside : whether it reads against the pressure inside the body.
    errors : (n_p,) operator of each error that it has in common with other sensors, one standard deviation, by
        name.
    shared : the same of errors that it has in common with the strain gauges, by their names there.
    drift : standard deviation of an offset that all readings of the same name of drift have in common [unit]; by
        that name.
    """

    name: str
    kind: str
    unit: str
    position: FloatArray
    direction: FloatArray
    operator: FloatArray
    std: float
    largest: float
    gain: float = 0.0
    per_axial_force: float = 0.0
    follows_inside: bool = False
    errors: dict[str, FloatArray] = field(default_factory=dict)
    shared: dict[str, FloatArray] = field(default_factory=dict)
    drift: dict[str, float] = field(default_factory=dict)
