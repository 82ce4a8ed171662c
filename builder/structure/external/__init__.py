"""Structures that the user's own finite-element code knows, without any mesh of ours.

Strain per snapshot: :mod:`~builder.structure.external.load_export` writes our pressures as nodal forces, one load
case per flight condition; :mod:`~builder.structure.external.strain_table` reads the gauges' strains back, and
:mod:`~builder.structure.external.strain_per_snapshot` makes a
:class:`~builder.structure.structure_file.Structure` of them, as the meshes of :mod:`builder.structure.solid` do.
"""
