"""End-to-end protection: CRC and counter checks, state machine, sample clock."""
