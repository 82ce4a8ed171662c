"""A space-marching finite-volume Euler solver for bodies with a pointed or spherical tip at incidence.

The steady Euler equations of a flow that is supersonic along the axis are an evolution in x. With
constant total enthalpy four of them remain: E = (rho u, rho u^2 + p, rho u v, rho u w) is carried from
cross-plane to cross-plane. From the bottom up: :mod:`~builder.aero.euler.gas` holds the gas relations,
:mod:`~builder.aero.euler.grid` the moving grid, :mod:`~builder.aero.euler.reconstruction` the states at faces,
:mod:`~builder.aero.euler.flux` the flux between two states, :mod:`~builder.aero.euler.fluxes` all fluxes of a
step, :mod:`~builder.aero.euler.bow_shock` the outer boundary, :mod:`~builder.aero.euler.march` the march,
:mod:`~builder.aero.euler.surface_function` the walls it follows, :mod:`~builder.aero.euler.plane` what a
cross-plane holds and balances, :mod:`~builder.aero.euler.corner` the way round a convex corner,
:mod:`~builder.aero.euler.sphere_flow` the flow over a spherical tip,
:mod:`~builder.aero.euler.spherical_start` the start behind it, and :mod:`~builder.aero.euler.body_march` the way
from tip to base.
:mod:`~builder.aero.euler.solver` marches half a body of revolution, :mod:`~builder.aero.euler.full_body` all
round a body of any star-shaped section.

Non-dimensional inside: free-stream density and speed of sound are 1, hence p_inf = 1/gamma, |V| = M.
"""
