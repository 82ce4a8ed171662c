"""What can be asked of a finished FMU: content, integrity, repetition by importers, cost of a step."""
