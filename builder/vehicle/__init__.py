"""The vehicle: its file, shape, gauges, flight conditions and options of the map. Nothing is solved here.

Read in this order: :mod:`~builder.vehicle.file` (a vehicle file, read and checked as a whole); what its entries
stand for: :mod:`~builder.vehicle.shape` (outer shape, pressure nodes), :mod:`~builder.vehicle.structure`,
:mod:`~builder.vehicle.gauges`, :mod:`~builder.vehicle.conditions`, :mod:`~builder.vehicle.model_entries` and
:mod:`~builder.vehicle.map_options`; :mod:`~builder.vehicle.toml` (values, units, limits, a wrong entry in one
line); last :mod:`~builder.vehicle.map_needs` and :mod:`~builder.vehicle.notebook_view`.
"""
