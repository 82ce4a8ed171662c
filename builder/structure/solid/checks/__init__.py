"""Checks before a mesh is solved on: bending of thin walls, layers in thick ones, strain under known loads."""
