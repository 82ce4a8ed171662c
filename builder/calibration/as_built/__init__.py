"""The vehicle that a calibration is scored on: what it flies as, and errors outside what is estimated."""
