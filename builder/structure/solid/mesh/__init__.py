"""Volume meshes with named surfaces: swept, of sections, by Gmsh or of other programs; checked and described."""
