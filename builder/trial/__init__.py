"""A trial: vehicles fly, drawn or given, under conditions and with faults; estimates of their readings are scored.

:mod:`~builder.trial.conditions` draws where they fly, :mod:`~builder.trial.readings` what they read there,
:mod:`~builder.trial.run` estimates by batches, :mod:`~builder.trial.score` defines every figure of a score, and
:mod:`~builder.trial.bound` is what no estimator can be better than.
"""
