"""Reports: tables that hold raw numbers, pages of HTML that need no other file, and what they say of a map."""
