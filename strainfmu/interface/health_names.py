"""Names of the outputs that state the health of an estimate, in FMUs and columns."""

HEALTH_PREFIX = "health."

STATE = f"{HEALTH_PREFIX}state"
CHI_SQUARE = f"{HEALTH_PREFIX}chi_square"
CHI_SQUARE_LIMIT = f"{HEALTH_PREFIX}chi_square_limit"
VALID_GAUGES = f"{HEALTH_PREFIX}valid_gauges"
SUSPECT_GAUGE = f"{HEALTH_PREFIX}suspect_gauge"
SUSPECTS = f"{HEALTH_PREFIX}suspects"
ENVELOPE_SCORE = f"{HEALTH_PREFIX}envelope_score"
USABLE = f"{HEALTH_PREFIX}usable"
LINEAR_LOADS = f"{HEALTH_PREFIX}linear_loads"
