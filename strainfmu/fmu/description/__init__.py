"""What an FMU states of itself: its description in FMI 2.0 and 3.0, its connectors and pictures."""
