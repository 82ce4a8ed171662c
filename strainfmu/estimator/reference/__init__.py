"""The mathematics of the estimator, written to be read: slow, short, and independent of the compiled core.

Everything is one Gaussian update, module ``update``. The other modules give its rows, columns and outputs:

============================  =====================================================================
``linear``                    a linear map, in both forms; errors at the current strain
``gain``                      gains, covariances and precisions of a linear map, as reports state them
``readings``                  zero offsets, auxiliary sensors, temperature: readings become rows
``air``                       air data: what is known of them, and what a flight state says of them
``nonlinear``                 strain about the tables; the flight state by Gauss-Newton iterations, loads there
``windows``                   the filter: averages over the last samples
============================  =====================================================================

It has no alarms and no state machines. Tests compare the core with it. Reports and studies take gains from it.
"""
