"""The estimator: from strain, air data and a map to loads and their health.

The data go one way. :mod:`~strainfmu.estimator.estimator` reads a map (``map``), hands it to the compiled
:mod:`~strainfmu.estimator.core` as bytes that ``resource`` writes, gives the core samples
(:mod:`~strainfmu.estimator.arguments`), and returns an :mod:`~strainfmu.estimator.estimate`. FMUs, Python,
recorded data and the bus use this core.

``reference`` is the theory in numpy, by which tests check the core. Off the deadline it gives the pressure on the
surface, section loads of form "absolute" and covariances for reports.
"""
