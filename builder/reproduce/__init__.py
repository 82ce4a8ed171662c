"""The source paper done again: every published number, table and figure next to our own."""
