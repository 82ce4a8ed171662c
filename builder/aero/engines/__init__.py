"""The engines by name: the marching Euler solver, half and all round, and modified Newtonian flow."""
