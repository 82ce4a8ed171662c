"""The three set-ups of every accuracy: the model of the map and the model of the data."""

from dataclasses import dataclass

import numpy as np

from builder.aero.load_operator import coefficient_scales_at, coefficients_of, load_operator
from builder.aero.surface.mesh import mesh_of_grid
from builder.campaign.snapshots import Snapshots
from builder.inverse.solution import area_weights
from builder.reproduce.paper_readings import SHIPPED
from builder.reproduce.protocol import EXAMPLES, HELD_OUT, NOISE_FRACTION, P1, P2
from builder.reproduce.strain_models import StrainModel
from builder.vehicle.shape.shape_entries import ReferenceQuantities
from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError
from strainfmu.flight_condition import FlightCondition

PAPER_LIKE, SAME_MESH, INDEPENDENT = "paper_like", "same_mesh", "independent"

TITLES = {
    PAPER_LIKE: "paper-like: linear tetrahedra, same mesh",
    SAME_MESH: "converged: quadratic hexahedra, same mesh",
    INDEPENDENT: "independent data",
}


@dataclass(frozen=True, eq=False, kw_only=True)
class Pressures:
    """Pressure snapshots on common nodes, with the operators to loads and coefficients.

    Attributes
    ----------
    p1, p2 : (90, n_p), (243, n_p) snapshots that maps are built on [Pa].
    held_out : (40, n_p) at conditions between the conditions of P1, on a finer flow grid [Pa].
    examples, fine_examples : (4, n_p) of :data:`~builder.reproduce.protocol.EXAMPLES`, on the snapshots' flow grid
        and on the finer one [Pa].
    internal : pressure inside the body [Pa].
    loads : (5, n_p) loads per nodal pressure [m2, m3].
    weights : (n_p,) of the area-weighted inner product [1].
    reference : what coefficients are referred to.
    """

    p1: FloatArray
    p2: FloatArray
    held_out: FloatArray
    examples: FloatArray
    fine_examples: FloatArray
    internal: float
    loads: FloatArray
    weights: FloatArray
    reference: ReferenceQuantities

    def coefficients(self, net: FloatArray, conditions: tuple[FlightCondition, ...]) -> FloatArray:
        """Return (N, 5) C_A, C_N, C_Y, M_P, M_Y of p - p_internal (N, n_p) [Pa]."""
        return coefficients_of(net, self.loads, conditions, self.reference)

    def scale(self, conditions: tuple[FlightCondition, ...]) -> FloatArray:
        """Return (N, 5) factors from loads [N, N m] to coefficients."""
        return coefficient_scales_at(conditions, self.reference)


def pressures(snapshots: Snapshots, fine: Snapshots) -> Pressures:
    """Split the sets: P1, P2 and the examples of ``snapshots``, held-out conditions and examples of ``fine``.

    Raises
    ------
    InputError
        The files do not hold these sets, or their nodes differ.
    """
    grid = snapshots.grid
    if grid is None or not np.array_equal(snapshots.point, fine.point):
        raise InputError("snapshots: both files must be on the same stations and roll angles")
    n_1, n_2 = len(P1.conditions), len(P2.conditions)
    for solved, sets in ((snapshots, (P1.conditions, P2.conditions)), (fine, (HELD_OUT.conditions,))):
        expected = [condition.as_tuple() for part in (*sets, tuple(EXAMPLES.values())) for condition in part]
        if not np.array_equal(solved.condition, expected):
            raise InputError("snapshots: the conditions do not follow the source's protocol")
    reference = snapshots.reference_quantities
    area = _node_area(mesh_of_grid(grid).node_area, grid.n_roll)
    return Pressures(
        p1=snapshots.pressure[:n_1],
        p2=snapshots.pressure[n_1 : n_1 + n_2],
        held_out=fine.pressure[: len(HELD_OUT.conditions)],
        examples=snapshots.pressure[n_1 + n_2 :],
        fine_examples=fine.pressure[len(HELD_OUT.conditions) :],
        internal=float(snapshots.internal_pressure[0]),
        loads=load_operator(grid, reference.moment_station),
        weights=area_weights(area),
        reference=reference,
    )


def _node_area(area: FloatArray, n_roll: int) -> FloatArray:
    """Divide the area of a ring evenly among its nodes, so that the triangulation does not break symmetry."""
    ring = area.reshape(-1, n_roll).mean(axis=1)
    return np.repeat(ring, n_roll)


@dataclass(frozen=True, eq=False, kw_only=True)
class SetUp:
    """The models behind a map and behind its data.

    Attributes
    ----------
    key : key of :data:`TITLES`.
    inversion, data : model of the map's Z, and model that gives the strains.
    sigma : standard deviation of the noise [m/m].
    """

    key: str
    inversion: StrainModel
    data: StrainModel
    sigma: float

    @property
    def held_out(self) -> bool:
        """Whether the flows of the data differ from the flows of the map."""
        return self.key == INDEPENDENT


def noise_sigma(model: StrainModel, p1_net: FloatArray) -> float:
    """Return sigma [m/m]: 1 % of the median |strain| over P1 and Configuration 2 of the shipped reading."""
    strain = p1_net @ model.operator_of(SHIPPED.configuration(2)).T
    return NOISE_FRACTION * float(np.median(np.abs(strain)))


def make_setups(
    tetrahedra: StrainModel, hexahedra: StrainModel, fourier: StrainModel, p1_net: FloatArray
) -> dict[str, SetUp]:
    """Return the set-ups by key; ``p1_net`` (90, n_p) [Pa] sets sigma."""
    pairs = {
        PAPER_LIKE: (tetrahedra, tetrahedra),
        SAME_MESH: (hexahedra, hexahedra),
        INDEPENDENT: (hexahedra, fourier),
    }
    return {
        key: SetUp(key=key, inversion=inversion, data=data, sigma=noise_sigma(inversion, p1_net))
        for key, (inversion, data) in pairs.items()
    }
