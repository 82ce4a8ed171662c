"""The report of a build: its numbers, its tables and its page."""
