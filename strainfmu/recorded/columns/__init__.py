"""The columns of a recording: which is which gauge, sensor or quantity of the flow, and in which unit."""
