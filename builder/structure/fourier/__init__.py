"""Structure as a body of revolution: finite elements in the meridian plane, Fourier series in roll angle.

The data go one way:

:mod:`~builder.structure.wall` (thickness, solid tip, material) and the body's meridian
-> :mod:`~builder.structure.fourier.shell_mesh` (quadrilaterals in the meridian plane, a
:class:`~builder.structure.fourier.meridian_mesh.MeridianMesh`)
-> :mod:`~builder.structure.fourier.fourier_elasticity` (one stiffness matrix per harmonic of the roll angle)
and :mod:`~builder.structure.fourier.strain_operator` (nodal forces per station pressure)
-> :mod:`~builder.structure.fourier.inner_surface` (where each gauge is and which strain it reads)
-> :mod:`~builder.structure.fourier.strain_operator` (Z_p: nodal surface pressure to gauge strain).
:mod:`~builder.structure.fourier.fourier_model` does all of it for a vehicle file.
"""
