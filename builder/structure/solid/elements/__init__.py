"""Elements and their faces: shape functions, quadrature, quality, closest points on curved facets."""
