"""strainfmu: aerodynamic loads in real time from structural strain (run-time package).

This package applies a finished inverse map: :mod:`strainfmu.estimator.inverse_map` is the artefact on disk,
:mod:`strainfmu.estimator.step` one step of it, :mod:`strainfmu.fmu` the FMU around it and
:mod:`strainfmu.cosim` the system simulation. It needs numpy and h5py only; the package ``builder``
makes the maps.
"""

__version__ = "0.1.0"
