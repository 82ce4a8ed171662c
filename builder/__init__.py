"""builder: from a vehicle file to an inverse map (off-line package).

The data go one way: :mod:`builder.vehicle.file` -> :mod:`builder.vehicle.geometry` -> :mod:`builder.aero` (surface
pressure) and :mod:`builder.structure` (strain per pressure) -> :mod:`builder.inverse` ->
``map.h5``, which :mod:`strainfmu` applies.
"""
