"""What all pages are made of: HTML that needs no other file, tables of raw numbers, figures with their values."""
