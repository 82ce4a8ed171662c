"""Whether an estimate is inside the envelope of its map."""

from strainfmu.estimator.map.envelope import envelope_score as envelope_score
from strainfmu.estimator.map.envelope import flight_ranges as flight_ranges
from strainfmu.estimator.map.envelope import half_spaces as half_spaces
from strainfmu.estimator.map.envelope import outside_by_navigation as outside_by_navigation
