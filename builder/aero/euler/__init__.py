"""A space-marching finite-volume Euler solver for bodies with a pointed or spherical tip at incidence.

The steady Euler equations of a flow that is supersonic along the axis are an evolution in x. With
constant total enthalpy four of them remain: E = (rho u, rho u^2 + p, rho u v, rho u w) is carried from
cross-plane to cross-plane. From the bottom up: :mod:`~builder.aero.euler.scheme` holds the compiled
scheme (gas, moving grid, states at faces, the flux between two states and all fluxes of a step, the bow shock as
outer boundary, the march); :mod:`~builder.aero.euler.planes` what a cross-plane holds and balances;
:mod:`~builder.aero.euler.starts` the conical flow over a pointed tip, the flow over a spherical tip and the start
behind it; :mod:`~builder.aero.euler.bodies` the walls that the march follows, the way round a convex corner and
that from tip to base: :mod:`~builder.aero.euler.bodies.solver` marches half a body of revolution,
:mod:`~builder.aero.euler.bodies.solver` all round a body of any star-shaped section.

Non-dimensional inside: free-stream density and speed of sound are 1, hence p_inf = 1/gamma, |V| = M.
"""
