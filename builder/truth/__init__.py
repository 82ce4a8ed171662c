"""The independent model of the vehicle, as built: finer flow and structure than the map's, hardware errors drawn.

:mod:`~builder.truth.as_built` draws a vehicle; :mod:`~builder.truth.revolution` and :mod:`~builder.truth.shape`
are the models, of bodies of revolution and of any shape; :mod:`~builder.truth.flights` flies them.
"""
