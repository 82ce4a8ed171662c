"""Aerodynamics: from a flight condition to the pressure on the vehicle's surface, and from pressure to loads.

Read in this order: :mod:`~builder.aero.engine` (what every source of pressure provides) and
:mod:`~builder.aero.engines` (the sources by name). The three sources: :mod:`~builder.aero.engines.euler` on
:mod:`~builder.aero.euler` (the marching solver); :mod:`~builder.aero.engines.newtonian` (pressure from local
inclination); :mod:`~builder.aero.cfd` (results of other solvers). :mod:`~builder.aero.shapes` makes the outer
surface of a vehicle, :mod:`~builder.aero.deflections` how it moves with a parameter of the flow;
:mod:`~builder.aero.surface` is the common form of a surface, :mod:`~builder.aero.pressure_map` carries pressure
and forces between two of them, :mod:`~builder.aero.load_operator` integrates pressure to forces and moments.
"""
