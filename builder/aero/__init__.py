"""Aerodynamics: from a flight condition to the pressure on the vehicle's surface, and from pressure to loads.

Read in this order: :mod:`~builder.aero.engine` (what every source of pressure provides) and
:mod:`~builder.aero.engines` (the sources by name). The three sources: :mod:`~builder.aero.euler_engine` on
:mod:`~builder.aero.euler` (the marching solver) and :mod:`~builder.aero.surface_pressure` (its wall pressure at
the surface nodes); :mod:`~builder.aero.newtonian` on :mod:`~builder.aero.local_inclination` and
:mod:`~builder.aero.edges` (a surface file made fit for it); :mod:`~builder.aero.cfd` (results of other solvers).
:mod:`~builder.aero.surface_mesh` is the common form of a surface, :mod:`~builder.aero.loads` integrates pressure
to forces and moments. Between two surfaces: :mod:`~builder.aero.closest_points`, :mod:`~builder.aero.mapping`,
:mod:`~builder.aero.mapping_report`. :mod:`~builder.aero.surface_parts` finds connected parts and merges nodes.
"""
