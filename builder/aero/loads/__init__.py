"""Forces and moments of a surface pressure: of the whole body, and of sections along it."""
