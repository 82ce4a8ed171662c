"""Covariance of strain about the tables."""

from strainfmu.estimator.map.strain_covariance import strain_covariance as strain_covariance
