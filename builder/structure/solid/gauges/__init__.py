"""B: strain gauges on surfaces of the mesh, their rows and their layouts."""
