"""Known loads: the strain of a structure's gauges under forces, pressure, weight, acceleration and temperature.

A ground test applies what is known, and the model gives what each gauge should read. The data go one way:

:mod:`~builder.structure.loads.applied` (the loads) and :mod:`~builder.structure.loads.temperature` (temperature
fields) -> nodal forces of a :class:`~builder.structure.loads.loaded_structure.LoadedStructure`:
:mod:`~builder.structure.loads.fourier` for the semi-analytic model, :mod:`~builder.structure.loads.solid` for the
three-dimensional one, :mod:`~builder.structure.loads.influence_structure` for strain per force of any other ->
:mod:`~builder.structure.loads.gauge_strain` (strain of every gauge).

Each structure is solved once, for its gauges; a load costs a product then.
"""
