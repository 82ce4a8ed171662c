"""Design of a ground test: which load cases to apply, and what each of them buys in flight."""
