"""What flow parameters, such as deflections, change, and errors once they are known.

Strain and loads are y(x) + p_inf sum_j (z^j - offset_j) s_j(x): z the parameter less its mean, over its spread in
the snapshots, s_j tables over the flight state. A value that is stated with a standard deviation counts together
with the spread, both taken as normal.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from strainfmu.arrays import FloatArray, IntArray
from strainfmu.errors import InputError
from strainfmu.records import inner_record

if TYPE_CHECKING:
    from strainfmu.estimator.tables.manifold_map import ManifoldMap


@dataclass(frozen=True, eq=False, kw_only=True)
class Powers:
    """J powers of n_p parameters.

    Attributes
    ----------
    mean, spread : (n_p,) of the parameters over the snapshots, a spread of 0 where they hold one value.
    parameter, power : (J,) of each power, its parameter and exponent.
    offset : (J,) mean of each power over the snapshots [1].
    """

    mean: FloatArray
    spread: FloatArray
    parameter: IntArray
    power: IntArray
    offset: FloatArray

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


@dataclass(frozen=True, eq=False, kw_only=True)
class ParameterTables:
    """Tables of n rows by J powers of n_p parameters: strains, then all loads.

    Attributes
    ----------
    powers : of the parameters.
    slope : (n_M + 2, n_a + 2, J, n, n_m, 2) spline coefficients per p_inf, on the knots of the tables of strain.
    unit_error : (J, n, k) errors per p_inf and unit of a power, over the states of the snapshots.
    spread_error : (n_p, n, k) errors per p_inf of a parameter that is not known.
    error : (n, k) the other errors of the map, per p_inf.
    """

    powers: Powers = field(metadata=inner_record(Powers, {}))
    slope: FloatArray
    unit_error: FloatArray
    spread_error: FloatArray
    error: FloatArray

    def check(self, shape: tuple[int, ...]) -> None:
        """Check shapes against ``shape`` of the tables of strain and loads.

        Raises
        ------
        InputError
            A shape is wrong or a value is not finite.
        """
        n_p, n_j, n = len(self.powers.mean), len(self.powers.power), shape[2]
        shapes = {
            "slope": (*shape[:2], n_j, n, *shape[3:]),
            "unit_error": (n_j, n, self.unit_error.shape[-1]),
            "spread_error": (n_p, n, self.spread_error.shape[-1]),
            "error": (n, self.error.shape[-1]),
        }
        for name, wanted in shapes.items():
            value = getattr(self, name)
            if value.shape != wanted or not np.all(np.isfinite(value)):
                raise InputError(
                    f"parameter tables: {name}: expected finite values of {wanted}, got {value.shape}"
                )


UNITS = dict.fromkeys(("slope", "unit_error", "spread_error", "error"), "1/Pa, m2, m3")


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


def with_known(manifold: ManifoldMap, value: FloatArray, std: FloatArray) -> ManifoldMap:
    """Return the tables and errors of ``manifold`` where parameters are known; the pressure on the surface stays
    as it is, see :func:`~strainfmu.estimator.tables.shape_field.field_with_known`.

    Parameters
    ----------
    value, std : (n_p,) of each parameter and its standard deviation, NaN of what is not known; ``manifold`` itself
        where nothing is.
    """
    tables = manifold.parameters
    if not np.any(np.isfinite(value) & np.isfinite(std)):
        return manifold
    assert tables is not None
    known = known_powers(tables.powers, value, std)
    errors = [tables.error, *known.errors(tables.unit_error, tables.spread_error)]
    return _changed(manifold, np.tensordot(tables.slope, known.shift, axes=(2, 0)), np.hstack(errors))


def _changed(manifold: ManifoldMap, change: FloatArray, errors: FloatArray) -> ManifoldMap:
    """Return ``manifold`` with ``change`` (n_M + 2, n_a + 2, n, n_m, 2) added to its tables, and ``errors``
    (n, k) per p_inf instead of its own."""
    n_d = manifold.n_gauges
    return replace(
        manifold, response=manifold.response + change, error_strain=errors[:n_d], error_load=errors[n_d:]
    )
