"""Calibration from a ground test: what a test says of the vehicle as built, and the map that follows.

:mod:`~builder.calibration.ground_test` holds the test: its load cases, its file, what the gauges read.
:mod:`builder.structure.as_built` gives the strain of any pressure field and of any known load for a vehicle as
built, which follows from a test in :mod:`~builder.calibration.estimate`. :mod:`~builder.calibration.plan` proposes
a test, :mod:`~builder.calibration.after_test` makes the map that follows, :mod:`~builder.calibration.score`
measures both.
"""
