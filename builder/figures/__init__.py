"""Figures of the builder, by what they show: snapshots, structures, maps, scenes, demonstration, comparisons.

All are drawn with what :mod:`~builder.figures.drawing` holds; none knows of another room but that one.
"""
