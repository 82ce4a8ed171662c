"""System simulation: the plant's physics, the co-simulation master and what it records.

:mod:`~strainfmu.cosim.models` computes what the FMUs other than the estimator do, :mod:`~strainfmu.cosim.systems`
runs connected FMUs and records them, :mod:`~strainfmu.cosim.estimators` steps an estimator for bridge and recorded
data. On them :mod:`~strainfmu.cosim.scenario` (a flight as a file) and :mod:`~strainfmu.cosim.flight` (the closed
loop); :mod:`~strainfmu.cosim.toml_table` reads TOML files entry by entry.
"""
