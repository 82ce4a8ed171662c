"""Results of other flow solvers: reading them, and writing the vehicle's surface for them.

Read in this order: :mod:`~builder.aero.cfd.manifest` (which file holds which flight condition),
:mod:`~builder.aero.cfd.results_table` (the engine: one file, converted, checked and mapped),
:mod:`~builder.aero.cfd.surface_field` (one form for all formats), :mod:`~builder.aero.cfd.units`,
:mod:`~builder.aero.cfd.surface_transfer` (axes, half models, normals), then what brings values in cells, at
nodes or at points without triangles to the nodes: :mod:`~builder.aero.cfd.surface_transfer`.
:mod:`~builder.aero.cfd.formats` holds one file format a module: ``cart3d``, ``stl``, ``vtk_files`` (with
``vtk_process`` and ``vtk_child``), ``point_table``, ``text_numbers``; ``surface_files`` reads and writes surfaces
of any of them.
"""
