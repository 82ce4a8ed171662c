"""A ground test: its load cases, its file, and what the gauges read under them, measured or simulated.

:mod:`~builder.calibration.ground_test.load_test_file` reads the file of a test
(:mod:`~builder.calibration.ground_test.load_entries` its loads),
:mod:`~builder.calibration.ground_test.ground_test_readings` the recordings that it names; both make a
:class:`~builder.calibration.ground_test.load_test.LoadTest`.
"""
