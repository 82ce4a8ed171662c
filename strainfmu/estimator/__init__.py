"""The estimator: map file, gains, masks, isolation, health, settings; the numpy reference of every FMU."""
