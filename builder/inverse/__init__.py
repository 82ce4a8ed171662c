"""Strain -> pressure state -> loads: modes and priors, the two inverse maps, their noise and their uncertainty."""
