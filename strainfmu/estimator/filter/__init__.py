"""Filters over time: what an estimator knows of a sample is carried to the next one."""
