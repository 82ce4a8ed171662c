"""The estimator: from strain, air data and a map to loads and their health.

The data go one way. :mod:`~strainfmu.estimator.estimator` reads a map (``map``, of which ``tables`` are the part
of the nonlinear estimator), hands it to the compiled :mod:`~strainfmu.estimator.core` as bytes that ``resource``
writes, and returns an :mod:`~strainfmu.estimator.estimate`. FMUs, Python, recorded data and the bus use this core.

``linear``, ``manifold`` and ``filter`` are a second implementation in numpy, by which tests check the core; it
computes the pressure on the surface and smooths recordings.
"""
