"""The short run inside every FMU that importers repeat: inputs, and the outputs that numpy computes for them."""
