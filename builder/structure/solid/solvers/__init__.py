"""Linear solvers of the structure behind one interface: :mod:`~builder.structure.solid.solvers.solver`.

Read in this order: :mod:`~builder.structure.solid.solvers.problem` (the linear problem and the checks of every
solution), :mod:`~builder.structure.solid.solvers.solver` (the choice),
:mod:`~builder.structure.solid.solvers.cyclic` (equal sectors), :mod:`~builder.structure.solid.solvers.back_end`,
then one file per back end.

The default needs scipy alone and is permissive. Every other back end is an extra; the output names the one in use
and its licence.
"""
