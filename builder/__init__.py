"""builder: from a vehicle file to an inverse map (off-line package).

    import builder

    vehicle = builder.load_vehicle(builder.IC3X)
    snapshots = builder.take_snapshots(vehicle, progress=True)
    structure = builder.solve_structure(vehicle)
    inverse_map = builder.build_map(vehicle, snapshots=snapshots, structure=structure)

``build_map(vehicle)`` alone runs all stages. Nothing is written to disk. The names below are loaded when they are
first used, so ``import builder`` costs nothing.

The data go one way: :mod:`builder.vehicle` -> :mod:`builder.aero` and :mod:`builder.campaign` (surface pressure),
:mod:`builder.structure` (strain per pressure) -> :mod:`builder.inverse` -> the map, for :mod:`strainfmu`.
"""

from strainfmu.public_names import lazily

__getattr__, __dir__ = lazily(__name__)
