"""The source's figures of Case 1 and Case 2, and its views of a field."""
