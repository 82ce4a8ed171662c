"""The inverse problem, from strain to pressure states and loads: modes, priors, both cases, noise, uncertainty.

The data go one way: :mod:`~builder.inverse.ensemble` of the snapshots -> :mod:`~builder.inverse.noise` and
:mod:`~builder.inverse.sensor_set`, what the gauges and other sensors read in addition to them ->
:mod:`~builder.inverse.solution` of a problem, either case ->
:mod:`~builder.inverse.loads` with their covariance, :mod:`~builder.inverse.envelope` of the map. A vehicle's
:mod:`~builder.inverse.problem` is solved and becomes the :mod:`~builder.inverse.build`;
:mod:`~builder.inverse.build` does both.
"""
