"""Interface of every source of surface pressure: a flight condition in, pressure at the surface nodes out.

Engines: :class:`builder.aero.engines.euler.EulerEngine` (the marching solver),
:class:`builder.aero.engines.newtonian.NewtonianEngine` (any closed surface),
:class:`builder.aero.cfd.results_table.TableEngine` (results of another solver, imported). A new engine implements
these members; campaigns, the command line and reports need no change.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from math import degrees
from typing import Any, Protocol

from builder.aero.surface.mesh import SurfaceMesh
from strainfmu.arrays import FloatArray
from strainfmu.flight_condition import FlightCondition

FlowKey = tuple[float, ...]
"""The identity of a flow: conditions with equal keys share one solution."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Flow:
    """One solved flow, as it is kept on disk.

    Attributes
    ----------
    key : the flow it is.
    arrays : what the engine needs to give pressures from it.
    momentum_error : relative difference of the force from wall pressure and from momentum; NaN if not known.
    mass_error : imbalance of mass between tip and base over the free stream's flow through the base's area; NaN
        if not known.
    repairs : states that had to be made physical; 0 in a clean run.
    """

    key: FlowKey
    arrays: Mapping[str, FloatArray]
    momentum_error: float = float("nan")
    mass_error: float = float("nan")
    repairs: int = 0


CAPPED_TO = "capped_to"
"""Array of a flow in which a sphere stands for the tip: up to which station [m]."""


def cap_line(flows: Iterable[Flow]) -> str | None:
    """Return in a line how large a sphere stands for the tip in flows of a body of revolution; None: in none."""
    capped = [flow for flow in flows if CAPPED_TO in flow.arrays]
    if not capped:
        return None
    largest = max(capped, key=lambda flow: float(flow.arrays[CAPPED_TO][0]))
    mach_number, incidence = largest.key[:2]
    return (
        f"euler: a sphere stands for the tip up to x = {1e3 * float(largest.arrays[CAPPED_TO][0]):.3g} mm "
        f"(M {mach_number:g}, total incidence {degrees(incidence):.3g} deg; less in other flows)"
    )


class Engine(Protocol):
    """A source of surface pressure for one vehicle. Engines are small, immutable and can be pickled."""

    @property
    def name(self) -> str:
        """Name at the user's edge: ``euler``, ``newtonian``, ``table``."""
        ...

    @property
    def surface(self) -> SurfaceMesh:
        """The vehicle's aerodynamic surface, at whose nodes pressures are given."""
        ...

    def inputs(self) -> Mapping[str, Any]:
        """Return everything a flow depends on besides its key, as JSON can hold it.

        A stored flow is valid as long as this and its key are unchanged. What only :meth:`pressure_ratio`
        depends on does not belong here.
        """
        ...

    def conditions(self) -> list[FlightCondition] | None:
        """Return the only conditions that have results, or None where any condition will do."""
        ...

    def flow_key(self, condition: FlightCondition) -> FlowKey:
        """Return the flow that ``condition`` needs; equal for conditions that differ by a symmetry alone."""
        ...

    def solve(self, key: FlowKey) -> Flow:
        """Solve one flow: the time-consuming part.

        Raises
        ------
        FlowReachError
            The flow is outside the engine's reach; the message names it.
        """
        ...

    def pressure_ratio(self, flow: Flow, condition: FlightCondition) -> FloatArray:
        """Return p/p_inf (n_p,) at the nodes of ``surface``: the flow turned to the condition's wind. Cheap."""
        ...
