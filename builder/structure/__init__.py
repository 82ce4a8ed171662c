"""Structure: from shape, wall and material to gauge strain per surface pressure, by two independent models.

:mod:`builder.structure.solid` is three-dimensional elasticity on any mesh; :mod:`builder.structure.fourier` is the
semi-analytic model of a body of revolution, harmonic by harmonic. Either stands as the check of the other.
:mod:`builder.structure.wall` says what the vehicle is made of.
"""
