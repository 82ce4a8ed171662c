"""A and C_map: stiffness, nodal forces of pressure, matter, supports and free flight."""
