"""Benchmarks for asv (airspeed velocity): the times that ``strainfmu bench`` prints, followed over commits."""

import sys
from pathlib import Path

# The maps are the tests' synthetic ones: numbers of a plausible size at no cost.
sys.path.append(str(Path(__file__).parents[1] / "tests" / "support"))
