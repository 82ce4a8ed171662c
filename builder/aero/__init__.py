"""Aerodynamics: from a flight condition to the pressure on the vehicle's surface.

:mod:`builder.aero.euler` solves the flow; :mod:`builder.aero.surface_pressure` puts its result on the
vehicle's pressure nodes; :mod:`builder.aero.loads` integrates pressure to forces and moments.
"""
