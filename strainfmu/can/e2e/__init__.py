"""End-to-end protection: checks of CRC and counter, the E2E state machine, the sender's clock."""
