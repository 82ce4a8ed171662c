"""The estimate of a cycle: flow and navigation that hold, the step of the estimator, its result, and a tare."""
