"""How this folder's functions are compiled."""

from __future__ import annotations

from numba import njit

compiled = njit(cache=True, nogil=True, error_model="numpy")
"""Decorator: machine code kept on disk, run without the interpreter lock, IEEE results for x/0.

A compiled function is renewed when its own file changes, not when a function that it calls does: after an
edit in this folder delete ``__pycache__``.
"""
