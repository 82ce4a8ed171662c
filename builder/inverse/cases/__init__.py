"""From strain to pressure states: Case 1, Case 2 with its prior and gamma, and the field that Case 2 gives."""
