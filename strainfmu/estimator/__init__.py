"""The estimator: from strain, navigation and a map to loads and their health; the numpy reference of every FMU.

The data go one way. :mod:`~strainfmu.estimator.loading` reads a map (``map``, of which ``tables`` are the part of
the nonlinear estimator) and makes its estimator: ``linear`` or ``manifold``, either one over time by ``filter``.
Readings come less their ``zeros``; ``estimates`` come out.
"""
