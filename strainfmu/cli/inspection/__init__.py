"""Tables of what a file holds, one module for each kind of file."""
