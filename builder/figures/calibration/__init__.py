"""Figures of a calibration: the ground test that is proposed, and the vehicle as built in flight."""
