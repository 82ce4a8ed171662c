"""Gauge strains out of Nastran's results: element strains of OP2 and punch files, by subcase.

:mod:`~builder.structure.external.nastran.results` reads files into rows of element strain,
:mod:`~builder.structure.external.nastran.results` says which element, side and angle each gauge is, and
:mod:`~builder.structure.external.nastran.results` fills the tables of the two routes with them.
:mod:`~builder.structure.external.load_export` writes load cases as cards.
"""
