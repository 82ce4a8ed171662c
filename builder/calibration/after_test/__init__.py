"""The map after a ground test: its operators, what the test left unknown, vehicles that it allows in flight."""
