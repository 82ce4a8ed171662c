"""Structure as a solid: three-dimensional linear elasticity of the vehicle, any shape.

:mod:`~builder.structure.solid.case` makes the input of a vehicle file,
:mod:`~builder.structure.solid.solid_model` runs the stages. The data go one way:

- Mesh, a :class:`~builder.structure.solid.solid_mesh.SolidMesh`, by ``mesh_choice``: swept round the axis or over
  sections (``swept_mesh``), by Gmsh (``gmsh_mesh``) or read (``mesh_files``); checked by ``mesh_checks``.
- Operators: ``stiffness`` (A), ``nodal_loads`` (C_map: pressure at the nodes of a surface to nodal forces),
  ``gauge_rows`` (B: gauge strain per displacement), on ``elements``. Gauges of a vehicle file: ``gauge_layouts``.
- Solution: ``supports`` or the inertia of ``matter``, solvers (``sparse_problem``, ``linear_solvers``),
  then Z_p = B A^-1 C_map by ``strain_solution``; ``cyclic`` on a mesh of equal sectors.
- Checks by closed forms and by another mesh: ``checks``.

Default solvers need scipy alone and are permissive; the output names the solver in use and its licence.
A displacement component is dof = 3 * node + component, components along body axes x, y, z.
"""
