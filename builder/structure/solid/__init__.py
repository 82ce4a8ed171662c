"""Structure as a solid: three-dimensional linear elasticity of the vehicle, any shape.

:mod:`~builder.structure.solid.case` makes the input of a vehicle file, :mod:`~builder.structure.solid.model` runs
the stages. The data go one way:

- Mesh: :mod:`~builder.structure.solid.mesh_choice` picks one, a
  :class:`~builder.structure.solid.mesh.solid_mesh.SolidMesh`: swept round the axis
  (:mod:`~builder.structure.solid.mesh.swept_mesh`), made by Gmsh (:mod:`~builder.structure.solid.mesh.gmsh_wall`,
  ``gmsh_files``) or read (:mod:`~builder.structure.solid.mesh.mesh_import`). It is checked (``mesh_checks``,
  ``locking``) and described (``mesh_report``).
- Operators: :mod:`~builder.structure.solid.operators.stiffness` (A),
  :mod:`~builder.structure.solid.operators.surface_load` (C_map: pressure at the nodes of a surface to nodal
  forces), :mod:`~builder.structure.solid.gauges.gauge_rows` (B: gauge strain per displacement), on
  :mod:`~builder.structure.solid.elements.elements`. The gauges of a vehicle file: ``gauge_layouts``,
  ``displaced_gauges``.
- Solution: :mod:`~builder.structure.solid.operators.supports` or
  :mod:`~builder.structure.solid.operators.free_flight`, a solver of :mod:`~builder.structure.solid.solvers`, then
  Z_p = B A^-1 C_map: :mod:`~builder.structure.solid.strain_operator` on the full mesh; ``cyclic_operator`` and
  ``cyclic_gauges`` on one of equal sectors; :mod:`~builder.structure.solid.solution` chooses.
- Error of the mesh: :mod:`~builder.structure.solid.checks.reference_loads`. For comparison alone:
  ``swept_tetrahedra``, ``growth``.

A displacement component is dof = 3 * node + component, components along body axes x, y, z.
"""
