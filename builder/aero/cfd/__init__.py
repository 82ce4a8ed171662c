"""Results of other flow solvers: reading them, and handing out our surface and our fields."""
