"""The independent model of the vehicle, as built: finer flow and structure than the map's, hardware errors drawn.

:mod:`~builder.truth.flights` draws a vehicle and flies it; :mod:`~builder.truth.true_structure` and
:mod:`~builder.truth.shape` are the models, of bodies of revolution and of any shape.
"""
