"""Calibration from a ground test: known loads, what the gauges read under them, and the as-built structure.

:mod:`~builder.calibration.load_test_file` reads the file of a test (:mod:`~builder.calibration.load_entries` its
loads), :mod:`~builder.calibration.readings` the recordings that it names; both make a
:class:`~builder.calibration.load_test.LoadTest`.

:mod:`~builder.calibration.as_built_structure` gives the strain of any pressure field and of any known load for a
vehicle as built, whose :mod:`~builder.calibration.as_built_parameters` a test estimates.
"""
