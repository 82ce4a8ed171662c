"""The source paper done again: every published number, table and figure beside our own."""
