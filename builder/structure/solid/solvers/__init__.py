"""Linear solvers of the structure behind one interface: :mod:`~builder.structure.solid.solvers.solver`.

The default path needs scipy alone and is permissive. Every other back end is an extra; the output names the one in
use and its licence.
"""
