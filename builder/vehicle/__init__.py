"""The vehicle: its file, shape, gauges, flight conditions and options of the map. Nothing is solved here.

Read in this order: :mod:`~builder.vehicle.file` (a vehicle file, read and checked as a whole),
:mod:`~builder.vehicle.sections` and :mod:`~builder.vehicle.map_options` (entries, units, limits),
:mod:`~builder.vehicle.faults` (a wrong entry in one line); then what the entries stand for:
:mod:`~builder.vehicle.geometry` (outer shape, pressure nodes), :mod:`~builder.vehicle.gauge_layout`,
:mod:`~builder.vehicle.flight_conditions`, :mod:`~builder.vehicle.reference_quantities`; last
:mod:`~builder.vehicle.map_needs` and :mod:`~builder.vehicle.notebook_view`.
"""
