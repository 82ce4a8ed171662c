"""Structure: from shape, wall and material to gauge strain per surface pressure, by two independent models.

:mod:`~builder.structure.fourier` is the semi-analytic model of a body of revolution, harmonic by harmonic;
:mod:`~builder.structure.solid` is three-dimensional elasticity on any mesh. Each checks the other.
:mod:`~builder.structure.as_built` is the strain of the vehicle as built, Z(theta): kinds of error in
:mod:`~builder.structure.as_built_kinds`.

Read in this order: :mod:`~builder.structure.wall` (what the vehicle is made of),
:mod:`~builder.structure.gauge_placement` (rows of gauges on the inner surface),
:mod:`~builder.structure.gauge_checks`; the models, each with its ``model.py`` first; then the results:
:mod:`~builder.structure.structure_file` (``structure.h5``), :mod:`~builder.structure.mapped_structure` (the solid
model's strain per pressure at the nodes of snapshots), :mod:`~builder.structure.observability` (what pressure a
layout responds to); :mod:`~builder.structure.loads`, known loads of a ground test on either model; and
:mod:`~builder.structure.external`, structures of the user's own finite-element code.
"""
