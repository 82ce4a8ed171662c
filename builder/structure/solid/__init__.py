"""Structure as a solid: three-dimensional linear elasticity of the vehicle, any shape.

The data go one way:

a :class:`~builder.structure.solid.solid_mesh.SolidMesh`, swept round the axis
(:mod:`~builder.structure.solid.swept_mesh`), made of a body's surface or imported
-> :mod:`~builder.structure.solid.stiffness` (A), :mod:`~builder.structure.solid.surface_load` (C_map: pressure at
the nodes of a surface to nodal forces), :mod:`~builder.structure.solid.gauge_rows` (B: gauge strain per
displacement)
-> :mod:`~builder.structure.solid.supports` (what holds the body) and a solver of
:mod:`~builder.structure.solid.solvers`
-> :mod:`~builder.structure.solid.strain_operator` (Z_p = B A^-1 C_map).

A displacement component is dof = 3 * node + component, components along body axes x, y, z.
"""
