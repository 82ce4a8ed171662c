"""strainfmu: aerodynamic loads in real time from structural strain.

    import strainfmu

    estimator = strainfmu.load("map.h5")
    result = estimator.estimate(strain, dynamic_pressure=95.8e3)
    result.C_N, result.sigma.C_N, result.health

Names are imported when they are used first. Applying a map needs numpy and h5py; the rest comes with the extras.
``strainfmu build`` makes the maps.
"""

from strainfmu.public_names import lazily
from strainfmu.version import __version__ as __version__

__getattr__, __dir__ = lazily(__name__)
