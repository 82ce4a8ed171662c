"""The vehicle as built: what may differ from its drawing, and the strain that follows, Z(theta)."""
