"""A wall whose thickness goes as cos(w phi): to first order it couples each harmonic n with n - w and n + w.

With the stiffness K of the even wall and D its derivative by the amplitude of the harmonic, the strain
b K^-1 f of a load f changes by -b K^-1 D K^-1 f. At every roll angle D is taken as the derivative of the even
wall's stiffness there, times cos(w phi); the slope of the inner surface round the body is left out, thickness over
radius of what is kept. The strain b on the inner surface moves with it, and so does the mass.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from builder.structure.fourier.fourier_elasticity import (
    FourierStiffness,
    assembled,
    some_elements,
    strain_displacement,
    stress_times_weight,
)
from builder.structure.fourier.meridian_mesh import MeridianMesh
from builder.structure.wall import Material
from strainfmu.arrays import FloatArray, IntArray

WAVES = (1, 2)
"""Harmonics w of the wall that are known."""

SIDES = (-1, 1, 0)
"""Difference of the harmonics of strain and load, over the wall's harmonic; 0 where the surface itself moves."""


@dataclass(frozen=True, eq=False)
class HarmonicProduct:
    """Stiffness between displacements of harmonic n (rows) and m: cc + m cl + n cl' + n m ll.

    Attributes
    ----------
    indices, indptr : pattern of the compressed rows.
    term : (4, n_nonzero) entries of cc, cl, cl' and ll, sums of B' C B over the constant part of B and the one
        that goes with the harmonic [N/m per radian].
    """

    indices: NDArray[np.intp]
    indptr: NDArray[np.intp]
    term: FloatArray

    def times(self, n: int, m: int, motion: FloatArray) -> FloatArray:
        """Return (n_dof, k) forces in harmonic ``n`` of motions (n_dof, k) in harmonic ``m``."""
        n_dof = len(self.indptr) - 1
        data = np.array([1.0, m, n, n * m]) @ self.term
        return np.asarray(csr_array((data, self.indices, self.indptr), shape=(n_dof, n_dof)) @ motion)

    def less(self, subtracted: HarmonicProduct, step: float) -> HarmonicProduct:
        """Return the difference to ``subtracted``, of the same pattern, over ``step``; without entries of zero."""
        term = (self.term - subtracted.term) / step
        nonzero = term.any(axis=0)
        return HarmonicProduct(
            self.indices[nonzero], np.concatenate([[0], np.cumsum(nonzero)])[self.indptr], term[:, nonzero]
        )


def harmonic_product(
    mesh: MeridianMesh, material: Material, like: FourierStiffness, elements: IntArray
) -> HarmonicProduct:
    """Return the stiffness of some ``elements`` (n,) of a wall between displacements of any two harmonics.

    ``like`` is the stiffness of a mesh of the same elements.
    """
    some = some_elements(mesh, elements)
    constant, linear, weight = strain_displacement(some)
    n_e = len(elements)
    of_constant, of_linear = (
        stress_times_weight(some, material, part, weight).reshape(n_e, -1, 27) for part in (constant, linear)
    )
    constant, linear = (part.reshape(n_e, -1, 27).transpose(0, 2, 1) for part in (constant, linear))
    mixed = constant @ of_linear
    blocks = constant @ of_constant, mixed, mixed.transpose(0, 2, 1), linear @ of_linear
    # The pattern is symmetric; its places are by columns.
    by_column = [block.transpose(0, 2, 1) for block in blocks]
    term = assembled(by_column, like.places_of(elements), len(like.indices))
    return HarmonicProduct(like.indices, like.indptr, term)


def neighbour_weight(n: int) -> float:
    """Return the part of cos(m phi), m = n +- w not both there if n = 0, in cos(w phi) cos(n phi)."""
    return 1.0 if n == 0 else 0.5


def reflected(adjoint: FloatArray) -> FloatArray:
    """Return strains (n_s, 3, n_dof) per force of harmonic -m from strains of m: what goes round changes sign."""
    mirrored = adjoint.copy()
    mirrored[:, 2] *= -1.0
    mirrored[..., 2::3] *= -1.0
    return mirrored


def times_cosine(force: FloatArray) -> FloatArray:
    """Return the amplitudes (2, n_m, .., 3) of cos(phi) times a field of nodal forces in the same form.

    Families and components are as in :mod:`builder.structure.loads.fourier`. What would go beyond the last
    harmonic is left out.
    """
    out = np.zeros_like(force)
    out[:, 1] = force[:, 0]
    out[:, 2:] = 0.5 * force[:, 1:-1]
    out[:, :-1] += 0.5 * force[:, 1:]
    # At m = 0 sines vanish: no motion round the body in the first family, none else in the second.
    out[0, 0, ..., 2] = 0.0
    out[1, 0, ..., :2] = 0.0
    return out


def times_sine(force: FloatArray) -> FloatArray:
    """Return the amplitudes of sin(phi) times a field: as cos(phi) in a frame rolled by a quarter turn."""
    turned = times_cosine(rolled_quarter(force))
    return rolled_quarter(rolled_quarter(rolled_quarter(turned)))


def times_waves(force: FloatArray) -> list[list[FloatArray]]:
    """Return, for each of :data:`WAVES`, the amplitudes of cos(w phi) and of sin(w phi) times a field."""
    cosine = times_cosine(force)
    return [
        [cosine, times_sine(force)],
        [2.0 * times_cosine(cosine) - force, 2.0 * times_sine(cosine)],
    ]


def rolled_quarter(force: FloatArray, wave: int = 1) -> FloatArray:
    """Return amplitudes (2, n_m, ..) referred to a quarter of the wall's period: phi' = phi - pi / (2 wave)."""
    m = np.arange(force.shape[1]).reshape(-1, *[1] * (force.ndim - 2))
    cosine, sine = quarter_turns(m, wave)
    return np.stack([cosine * force[0] + sine * force[1], cosine * force[1] - sine * force[0]])


def quarter_turns(m: IntArray, wave: int) -> tuple[FloatArray, FloatArray]:
    """Return cosine and sine of harmonics ``m`` over a quarter of the wall's period, 0 and +-1 exactly so."""
    angle: FloatArray = 0.5 * np.pi * np.asarray(m, dtype=np.float64) / wave
    return np.cos(angle).round(15), np.sin(angle).round(15)
