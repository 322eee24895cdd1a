"""Points in tetrahedra: location, barycentric weights, interpolation. No VTK."""
