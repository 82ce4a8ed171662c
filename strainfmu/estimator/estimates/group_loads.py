"""Loads behind the five of an estimate, by the group or family that they are of."""

from __future__ import annotations

from dataclasses import dataclass

from strainfmu.arrays import FloatArray


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
