"""The command ``strainfmu``: the only place of this package that imports ``builder``."""
