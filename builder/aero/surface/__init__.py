"""Triangulated surfaces that carry pressure at their nodes: parts, edges, cuts, the points closest to others."""
