"""The bus itself: opened by python-can, read and written below it, opened again when it fails."""
