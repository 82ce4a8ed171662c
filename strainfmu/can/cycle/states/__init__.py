"""States that go over the bus, and words for them: quality of a result and its causes, state of the controller."""
