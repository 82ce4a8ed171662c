"""A trial: vehicles fly, drawn or given, with faults; what they read is estimated and scored in one long table.

:mod:`~builder.trial.cases` reads what is tried, :mod:`~builder.trial.readings` flies it and says what is read,
:mod:`~builder.trial.estimators` estimates,
:mod:`~builder.trial.score` defines every figure of a score and judges,
:mod:`~builder.trial.table` shows, :mod:`~builder.trial.run` runs all of it. :mod:`~builder.trial.bound` is what no
estimator can be better than, :mod:`~builder.trial.levels` takes alarm levels from a trial.
"""
