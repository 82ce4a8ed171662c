"""Cost of the parts of a map: one march of the Euler solver and one structure, both of the shipped vehicle."""

from math import radians

from builder.aero.euler.bodies.solver import solve_flow
from builder.structure.fourier.fourier_model import structural_model
from builder.vehicle.file import IC3X, load_vehicle


class Flow:
    """The flow over the vehicle at M 6 and 5 deg on the default grid, compiled before."""

    timeout = 600

    def setup(self) -> None:
        self.body = load_vehicle(IC3X).body()
        self.time_march()

    def time_march(self) -> None:
        solve_flow(self.body, 6.0, radians(5.0))


class Structure:
    """Strain of all gauges per harmonic of the pressure, at the resolution of the map."""

    timeout = 600

    def setup(self) -> None:
        self.vehicle = load_vehicle(IC3X)

    def time_solve(self) -> None:
        structural_model(self.vehicle, self.vehicle.resolution.map, list(self.vehicle.gauges.layouts))
