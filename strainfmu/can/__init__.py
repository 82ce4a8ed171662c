"""The CAN bridge: strain frames in, coefficients out.

Rooms from the ground up: ``wire`` (frames, signals, CRC, DBC files), ``e2e`` (end-to-end checks and the sender's
clock), ``cycle`` (frames assembled to cycles, judged, stepped through the estimator; no threads, no sockets),
``bridge`` (the cycle on a live bus), ``tools`` (send, inject faults, record, replay). ``settings`` holds limits
and times.
"""
