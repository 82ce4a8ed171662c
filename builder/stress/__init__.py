"""The stress test of a map: errors of many kinds on flights of the independent model, and what health says."""
