"""Estimators as bridge and recorded data take them: an FMU's step, its description, zeros of the gauges."""
