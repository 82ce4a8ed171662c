"""Observability of pressure by a gauge layout: its response per harmonic round the axis, per symmetry, in all.

All responses are to smooth pressures: Legendre polynomials of x over the length of the surface times
cos(m phi) and sin(m phi), phi the roll angle from +z towards +y. They are made orthogonal, of mean square 1 Pa2
over the area, so that a response is strain per rms pressure [1/Pa]. It does not depend on the mesh that carries
the pressure, as the singular values of Z_p itself do: the column of a node grows with its part of the surface.
Dividing columns by the root of the nodal area cures that where pressure is linear between nodes, but not on
quadratic facets, whose corners carry no load or a negative one (Cook, Malkus and Plesha, Concepts and Applications
of Finite Element Analysis, on consistent loads of quadratic elements): there it is wrong by a factor of about 1.7.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from strainfmu.arrays import BoolArray, FloatArray, IntArray
from strainfmu.errors import InputError

HIGHEST_DEGREE = 20
"""Of the Legendre polynomials over which singular values are taken: waves of a tenth of the length."""

CLASS_DEGREE = 3
"""Of those that stand for the pressure of one harmonic or symmetry."""

HIGHEST_HARMONIC = 8

THRESHOLD = 0.01
"""Of the largest singular value of a layout: below it counts as unobservable. Strain noise is of that order."""

MAX_CONDITION = 1e8
"""Of the Gram matrix of the smooth pressures, above which the mesh does not distinguish them."""


@dataclass(frozen=True, eq=False, kw_only=True)
class SmoothResponse:
    """Strain of gauges under smooth pressures on one surface.

    Attributes
    ----------
    degree, harmonic, sine : (k,) of each pressure: P_degree(x) cos(m phi), or sin(m phi) where ``sine``; all
        degrees of the wave 0, then of cos 1, sin 1, cos 2, ...
    strain : (n_d, k) strain under each [1/Pa].
    gram : (k, k) mean of the product of two of them over the surface [1].
    area : of the surface [m2].
    x_range : first and last x of the surface [m], to which the Legendre polynomials refer.
    """

    degree: IntArray
    harmonic: IntArray
    sine: BoolArray
    strain: FloatArray
    gram: FloatArray
    area: float
    x_range: tuple[float, float]

    def at_gauges(self, gauges: IntArray) -> SmoothResponse:
        """Return the response of some of the gauges."""
        return replace(self, strain=self.strain[gauges])

    def restricted(self, chosen: BoolArray) -> FloatArray:
        """Return (n_d, n) response [1/Pa] to the n chosen pressures, made orthogonal with mean square 1 Pa2."""
        factor = np.linalg.cholesky(self.gram[np.ix_(chosen, chosen)])
        return np.asarray(np.linalg.solve(factor, self.strain[:, chosen].T).T)

    def singular_values(self, chosen: BoolArray | None = None) -> FloatArray:
        """Return (min(n_d, n),) singular values [1/Pa] of Z_p on the chosen pressures, on all by default.

        In them strain is the root of the sum of its squares over the gauges, pressure is rms over the surface.
        """
        chosen = np.ones(len(self.degree), dtype=bool) if chosen is None else chosen
        return np.asarray(np.linalg.svd(self.restricted(chosen), compute_uv=False))

    def influence(self, x: FloatArray, roll_angle: FloatArray) -> FloatArray:
        """Return strain per pressure and area [1/(Pa m2)] at stations [m] and roll angles [rad].

        Strain is the integral of influence times pressure over the surface, for smooth pressures; of the influence
        itself it is the part that they span, so the dent right at a gauge is left out.

        Returns
        -------
        (n_d, n_x, n_roll).
        """
        along, around = np.meshgrid(x, roll_angle, indexing="ij")
        shape = _shapes(
            along.ravel(), around.ravel(), self.x_range, int(self.degree.max()), int(self.harmonic.max())
        )
        values = np.linalg.solve(self.gram, self.strain.T).T @ shape.T / self.area
        return np.asarray(values.reshape(-1, len(x), len(roll_angle)))


def smooth_response(
    strain_operator: FloatArray,
    point: FloatArray,
    area: FloatArray,
    degree: int = HIGHEST_DEGREE,
    highest_harmonic: int = HIGHEST_HARMONIC,
) -> SmoothResponse:
    """Return the response of gauges to smooth pressures, all that the other functions here need.

    Parameters
    ----------
    strain_operator : (n_d, n_p) Z_p, strain per nodal pressure [1/Pa].
    point : (n_p, 3) nodes in body axes [m]; any surface round the x axis.
    area : (n_p,) part of the surface [m2] that belongs to each node, such as a third of the triangles at it.
    degree, highest_harmonic : of the pressures.

    Raises
    ------
    InputError
        Shapes do not fit, a value is not finite, an area is negative, or the surface has too few nodes to
        distinguish the pressures.
    """
    _check(strain_operator, point, area)
    x_range = float(point[:, 0].min()), float(point[:, 0].max())
    shape = _shapes(point[:, 0], np.arctan2(point[:, 1], point[:, 2]), x_range, degree, highest_harmonic)
    strain = strain_operator @ shape
    shape *= np.sqrt(area / area.sum())[:, None]
    gram = shape.T @ shape
    if not np.linalg.cond(gram) < MAX_CONDITION:
        raise InputError(
            f"surface: its {len(point)} nodes do not distinguish pressures of degree {degree} in x and "
            f"harmonic {highest_harmonic}; more nodes are needed"
        )
    waves = [(m, sine) for m in range(highest_harmonic + 1) for sine in (False, True) if m or not sine]
    return SmoothResponse(
        degree=np.tile(np.arange(degree + 1), len(waves)),
        harmonic=np.repeat([m for m, _ in waves], degree + 1).astype(np.int64),
        sine=np.repeat([sine for _, sine in waves], degree + 1),
        strain=strain,
        gram=gram,
        area=float(area.sum()),
        x_range=x_range,
    )


def _check(strain_operator: FloatArray, point: FloatArray, area: FloatArray) -> None:
    n = len(point)
    if point.shape != (n, 3) or area.shape != (n,) or strain_operator.ndim != 2 or strain_operator.shape[1] != n:
        raise InputError(
            f"strain operator {strain_operator.shape}, points {point.shape}, areas {area.shape} found, must be "
            "n_d x n_p, n_p x 3 and n_p"
        )
    for name, values in (("strain operator", strain_operator), ("point", point), ("area", area)):
        if not np.isfinite(values).all():
            raise InputError(f"{name}: holds a value that is not finite")
    if not (area >= 0.0).all() or not area.sum() > 0.0 or not np.ptp(point[:, 0]) > 0.0:
        raise InputError("surface: areas must be at least 0, their sum and the length in x greater than 0")


def _shapes(
    x: FloatArray, roll_angle: FloatArray, x_range: tuple[float, float], degree: int, highest_harmonic: int
) -> FloatArray:
    """Return (n, k) values of the smooth pressures at n points, in the order of :class:`SmoothResponse`."""
    first, last = x_range
    along = np.polynomial.legendre.legvander(2.0 * (x - first) / (last - first) - 1.0, degree)
    phase = np.outer(roll_angle, np.arange(1, highest_harmonic + 1))
    around = np.ones((len(x), 2 * highest_harmonic + 1))
    around[:, 1::2], around[:, 2::2] = np.cos(phase), np.sin(phase)
    return np.asarray((around[:, :, None] * along[:, None, :]).reshape(len(x), -1))


@dataclass(frozen=True)
class Symmetry:
    """A class of pressures: even or odd under y -> -y (port and starboard) and under z -> -z (below and above)."""

    even_in_y: bool
    even_in_z: bool

    def __str__(self) -> str:
        in_y, in_z = ("even" if even else "odd" for even in (self.even_in_y, self.even_in_z))
        return f"{in_y} in y, {in_z} in z"

    def waves(self, harmonic: IntArray, sine: BoolArray) -> BoolArray:
        """Return which waves are of the class.

        With y = r sin(phi), z = r cos(phi), y -> -y turns phi to -phi, z -> -z to pi - phi: cos(m phi) is even
        in y, sin(m phi) odd; in z cos(m phi) has the parity of m, sin(m phi) the other.
        """
        even_m = harmonic % 2 == 0
        return (sine != self.even_in_y) & ((even_m != sine) == self.even_in_z)


SYMMETRIES = tuple(Symmetry(y, z) for y in (True, False) for z in (True, False))


@dataclass(frozen=True, eq=False)
class SymmetryResponse:
    """Response of a layout to one class of pressures.

    Attributes
    ----------
    symmetry : the class.
    singular_values : of Z_p on it [1/Pa], greatest first; the first is the norm.
    rank : how many of them count.
    """

    symmetry: Symmetry
    singular_values: FloatArray
    rank: int

    @property
    def norm(self) -> float:
        return float(self.singular_values[0])

    @property
    def blind(self) -> bool:
        return self.rank == 0


def symmetry_responses(
    response: SmoothResponse, degree: int = CLASS_DEGREE, threshold: float = THRESHOLD
) -> list[SymmetryResponse]:
    """Return the response of a layout to each of :data:`SYMMETRIES`, pressures up to ``degree`` in x.

    A singular value counts where it is above ``threshold`` times the greatest of all classes. A layout of rank 0
    in a class does not observe such pressure.
    """
    low = response.degree <= degree
    responses = [
        response.singular_values(low & symmetry.waves(response.harmonic, response.sine)) for symmetry in SYMMETRIES
    ]
    lowest = threshold * max(float(values[0]) for values in responses)
    return [
        SymmetryResponse(symmetry, values, int((values > lowest).sum()))
        for symmetry, values in zip(SYMMETRIES, responses, strict=True)
    ]


def wave_names(highest_harmonic: int = HIGHEST_HARMONIC) -> list[str]:
    """Return the names of the columns of :func:`wave_response`: 0, cos 1, sin 1, cos 2, ..."""
    return ["0", *(f"{wave} {m}" for m in range(1, highest_harmonic + 1) for wave in ("cos", "sin"))]


def wave_response(response: SmoothResponse, degree: int = CLASS_DEGREE) -> FloatArray:
    """Return the greatest |strain| of each gauge under pressure of one wave round the axis and 1 Pa rms.

    Returns
    -------
    (n_d, 2 highest_harmonic + 1) [1/Pa], over all pressures up to ``degree`` in x; columns as :func:`wave_names`.
    """
    low = response.degree <= degree
    columns = []
    for m in range(int(response.harmonic.max()) + 1):
        for sine in (False, True) if m else (False,):
            chosen = low & (response.harmonic == m) & (response.sine == sine)
            columns.append(np.linalg.norm(response.restricted(chosen), axis=1))
    return np.stack(columns, axis=1)


def angle_from_meridian(position: FloatArray, direction: FloatArray) -> FloatArray:
    """Return the angle (n,) [rad] of gauges (n, 3) from the meridian aft towards increasing roll angle.

    In (-pi/2, pi/2]: 0 is axial, pi/2 hoop; a gauge has no sense of direction. For gauges that lie in the surface
    of a body whose sections are near circles round the x axis.
    """
    roll = np.arctan2(position[:, 1], position[:, 2])
    across = direction[:, 1] * np.cos(roll) - direction[:, 2] * np.sin(roll)
    across = np.clip(across / np.linalg.norm(direction, axis=1), -1.0, 1.0)
    aft = np.where(direction[:, 0] < 0.0, -1.0, 1.0)
    angle = np.arctan2(aft * across, np.sqrt(1.0 - across**2))
    return np.where(angle <= 1e-6 - 0.5 * np.pi, 0.5 * np.pi, angle)


def direction_names(position: FloatArray, direction: FloatArray, tolerance: float = np.deg2rad(0.5)) -> list[str]:
    """Return ``"axial"``, ``"hoop"`` or the angle in degrees of each gauge; see :func:`angle_from_meridian`."""
    names = []
    for angle in angle_from_meridian(position, direction):
        if abs(angle) <= tolerance:
            names.append("axial")
        elif abs(angle) >= 0.5 * np.pi - tolerance:
            names.append("hoop")
        else:
            names.append(f"{np.rad2deg(angle):.1f} deg")
    return names
