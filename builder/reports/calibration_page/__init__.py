"""The report of a calibration: what it rests on, its verdict, tables and figures, and the page of all."""
