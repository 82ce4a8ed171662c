"""What flow parameters, such as deflections, change, and errors once they are known.

Strain and loads are y(x) + p_inf sum_j (z^j - offset_j) s_j(x): z the parameter less its mean, over its spread in
the snapshots, s_j tables over the flight state. A value that is stated with a standard deviation counts together
with the spread, both taken as normal.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from strainfmu.arrays import FloatArray, IntArray
from strainfmu.estimator.tables.schema import FROM_0, check, described, entry


@described
@dataclass(frozen=True, eq=False, kw_only=True)
class Powers:
    """J powers of n_p parameters."""

    # fmt: off
    mean: FloatArray = entry("n_p", "", "of the parameters over the snapshots", place="parameter_tables.mean")
    spread: FloatArray = entry("n_p", "", "the same, 0 where they hold one value", place="parameter_tables.spread",
        rule=FROM_0)
    parameter: IntArray = entry("J", "", "parameter of each power, ascending", place="parameter_tables.parameter")
    power: IntArray = entry("J", "", "exponent of each power, 1 to 3", place="parameter_tables.power")
    offset: FloatArray = entry("J", "1", "mean of each power over the snapshots", place="parameter_tables.offset")
    # fmt: on

    def change(self, values: FloatArray, left: FloatArray | float = 0.0) -> FloatArray:
        """Return (k, J) each power of ``values`` (k, n_p), less its mean [1].

        ``left`` (n_p,) are variances of z about the values; powers up to 3 are those expected.
        """
        z, power = self._scaled(values), self.power
        variance = np.broadcast_to(left, self.mean.shape)[self.parameter]
        pairs = 0.5 * power * (power - 1) * variance
        return np.asarray(z**power + pairs * z ** np.maximum(power - 2, 0) - self.offset)

    def derivative(self, values: FloatArray) -> FloatArray:
        """Return (k, J) derivatives of the powers of ``values`` (k, n_p) by z."""
        return np.asarray(self.power * self._scaled(values) ** (self.power - 1))

    def _scaled(self, values: FloatArray) -> FloatArray:
        z = (values - self.mean) / np.where(self.spread > 0.0, self.spread, 1.0)
        return np.asarray(z[:, self.parameter])


@described
@dataclass(frozen=True, eq=False, kw_only=True)
class ParameterTables:
    """Tables of n rows by J powers of n_p parameters: strains, then all loads."""

    # fmt: off
    powers: Powers = entry(unit="", meaning="of the parameters", record=Powers)
    slope: FloatArray = entry("n_M+2 n_a+2 J n n_m 2", "1/Pa, m2, m3",
        "spline coefficients per p_inf, on the knots of the tables of strain")
    unit_error: FloatArray = entry("J n k_unit", "1/Pa, m2, m3",
        "errors per p_inf and unit of a power, over the states of the snapshots")
    spread_error: FloatArray = entry("n_p n k_spread", "1/Pa, m2, m3",
        "errors per p_inf of a parameter that is not known")
    error: FloatArray = entry("n k_rest", "1/Pa, m2, m3", "the other errors of the map, per p_inf")
    # fmt: on

    def check(self, shape: tuple[int, ...]) -> None:
        """Check shapes against ``shape`` of the tables of strain and loads.

        Raises
        ------
        InputError
            A shape is wrong or a value is not finite.
        """
        sizes = {"n_M": shape[0] - 2, "n_a": shape[1] - 2, "n": shape[2], "n_m": shape[3]}
        sizes |= {"n_p": len(self.powers.mean), "J": len(self.powers.power)}
        check(self, "parameter tables", **sizes)


@dataclass(frozen=True, eq=False, kw_only=True)
class KnownPowers:
    """What is known of the J powers of n_p parameters.

    Attributes
    ----------
    powers : of the parameters.
    shift : (J,) each power that is known, less its mean [1].
    weight : (n_p,) of a stated value against the spread, 0 where nothing is known.
    derivative : (J,) of each power by z about what is known.
    """

    powers: Powers
    shift: FloatArray
    weight: FloatArray
    derivative: FloatArray

    def errors(self, unit_error: FloatArray, spread_error: FloatArray) -> list[FloatArray]:
        """Return the columns (n, k) that are left of the errors of one unit of each power (J, n, k) and of the
        spread of each parameter (n_p, n, k).

        What a standard deviation leaves is in proportion to it about a value well known, and the spread of one
        that is not.
        """
        found = []
        for parameter, part in enumerate(self.weight.tolist()):
            own = self.powers.parameter == parameter
            by_one = self.derivative[own] * np.sqrt(part * (1.0 - part))
            found += [np.tensordot(by_one, unit_error[own], 1), (1.0 - part) * spread_error[parameter]]
        return found


def known_powers(powers: Powers, value: FloatArray, std: FloatArray) -> KnownPowers:
    """Return what is known of ``powers``; ``value`` and ``std`` as of :func:`with_known`."""
    variance = powers.spread**2
    known = np.isfinite(value) & np.isfinite(std) & (variance > 0.0)
    with np.errstate(over="ignore"):  # of a deviation so large that nothing is known
        weight = np.where(known, variance / np.where(known, variance + std**2, 1.0), 0.0)
    middle = (powers.mean + weight * np.where(known, value - powers.mean, 0.0))[None]
    return KnownPowers(
        powers=powers,
        shift=np.where(known[powers.parameter], powers.change(middle, 1.0 - weight)[0], 0.0),
        weight=weight,
        derivative=powers.derivative(middle)[0],
    )
