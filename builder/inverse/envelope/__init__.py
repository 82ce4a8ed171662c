"""Where a map holds: bounds of coefficients and flight, and the limit of the envelope score."""
