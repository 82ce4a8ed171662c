"""Loads and coefficients of an estimate by name, and what is read of an estimate to show it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol

from strainfmu.arrays import BoolArray, FloatArray, float_or_array
from strainfmu.estimator.other_loads import LoadGroup


class NamedLoads:
    """Loads and coefficients by name, a float of one sample and (k,) of k: the last axis of ``loads`` and
    ``coefficients`` (.., 5), and of the other ones (.., m), the first of which is the rolling moment."""

    loads: FloatArray
    coefficients: FloatArray
    other_loads: FloatArray
    other_coefficients: FloatArray

    @property
    def axial_force(self) -> Any:
        """F_x [N], positive aft, of the fore-body."""
        return float_or_array(self.loads[..., 0])

    @property
    def normal_force(self) -> Any:
        """F_z [N], positive up."""
        return float_or_array(self.loads[..., 1])

    @property
    def side_force(self) -> Any:
        """F_y [N], positive to starboard."""
        return float_or_array(self.loads[..., 2])

    @property
    def pitching_moment(self) -> Any:
        """Moment about y [N m], positive nose-up."""
        return float_or_array(self.loads[..., 3])

    @property
    def yawing_moment(self) -> Any:
        """Moment about z [N m], positive nose to starboard."""
        return float_or_array(self.loads[..., 4])

    @property
    def C_A(self) -> Any:
        """Coefficient of the axial force [1]."""
        return float_or_array(self.coefficients[..., 0])

    @property
    def C_N(self) -> Any:
        """Coefficient of the normal force [1]."""
        return float_or_array(self.coefficients[..., 1])

    @property
    def C_Y(self) -> Any:
        """Coefficient of the side force [1]."""
        return float_or_array(self.coefficients[..., 2])

    @property
    def M_P(self) -> Any:
        """Coefficient of the pitching moment [1]."""
        return float_or_array(self.coefficients[..., 3])

    @property
    def M_Y(self) -> Any:
        """Coefficient of the yawing moment [1]."""
        return float_or_array(self.coefficients[..., 4])

    @property
    def rolling_moment(self) -> Any:
        """Moment about x [N m], positive with starboard going down; known to be zero for a body of revolution."""
        return float_or_array(self.other_loads[..., 0])

    @property
    def M_R(self) -> Any:
        """Coefficient of the rolling moment [1], C_l of the literature."""
        return float_or_array(self.other_coefficients[..., 0])


@dataclass(frozen=True, eq=False)
class Sigma(NamedLoads):
    """Standard deviations by name: of the ``loads`` (.., 5) [N, N m], of the ``coefficients`` (.., 5) [1], and of
    the other loads (.., m)."""

    loads: FloatArray
    coefficients: FloatArray
    other_loads: FloatArray
    other_coefficients: FloatArray


@dataclass(frozen=True, eq=False)
class GroupLoads:
    """One load at n places: the axial force of every section, for example.

    Attributes
    ----------
    places : n texts, as in the descriptions of an FMU's outputs; one empty text of the whole body.
    loads, std : (.., n) loads and their standard deviations [N, N m].
    coefficients, coefficients_std : (.., n) loads over q_inf S, moments over q_inf S L, and standard deviations
        [1].
    """

    places: tuple[str, ...]
    loads: FloatArray
    std: FloatArray
    coefficients: FloatArray
    coefficients_std: FloatArray


@dataclass(frozen=True, eq=False)
class SectionLoads:
    """Loads of n_s sections along the body, of the air on the part ahead of each of them.

    Attributes
    ----------
    station : (n_s,) x of the sections [m].
    loads : (.., n_s, 6) axial force, normal and side shear [N], pitch and yaw bending moment, torsion [N m].
    std : (.., n_s, 6) their standard deviations.
    """

    station: FloatArray
    loads: FloatArray
    std: FloatArray

    @property
    def axial(self) -> FloatArray:
        """(.., n_s) axial force [N], positive aft."""
        return self.loads[..., 0]

    @property
    def normal_shear(self) -> FloatArray:
        """(.., n_s) shear force along z [N], positive up."""
        return self.loads[..., 1]

    @property
    def side_shear(self) -> FloatArray:
        """(.., n_s) shear force along y [N], positive to starboard."""
        return self.loads[..., 2]

    @property
    def pitch_bending(self) -> FloatArray:
        """(.., n_s) bending moment about y [N m], positive nose-up."""
        return self.loads[..., 3]

    @property
    def yaw_bending(self) -> FloatArray:
        """(.., n_s) bending moment about z [N m], positive nose to starboard."""
        return self.loads[..., 4]

    @property
    def torsion(self) -> FloatArray:
        """(.., n_s) torsion moment about x [N m], positive with starboard going down."""
        return self.loads[..., 5]


class ShownEstimate(Protocol):
    """What axes, text and tables read of an estimate of one sample, or of k samples with a first axis more."""

    @property
    def loads(self) -> FloatArray: ...
    @property
    def loads_std(self) -> FloatArray: ...
    @property
    def coefficients(self) -> FloatArray: ...
    @property
    def coefficients_std(self) -> FloatArray: ...
    @property
    def coefficient_covariance(self) -> FloatArray: ...
    @property
    def other_loads(self) -> FloatArray: ...
    @property
    def other_loads_std(self) -> FloatArray: ...
    @property
    def other_coefficients(self) -> FloatArray: ...
    @property
    def other_coefficients_std(self) -> FloatArray: ...
    @property
    def load_groups(self) -> tuple[LoadGroup, ...]: ...
    @property
    def chi_square(self) -> Any: ...
    @property
    def chi_square_limit(self) -> Any: ...
    @property
    def health(self) -> Any: ...

    @property
    def usable(self) -> Any: ...
    @property
    def valid(self) -> BoolArray: ...
    def __len__(self) -> int: ...
