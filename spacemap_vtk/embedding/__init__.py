"""Points in tetrahedra: location, barycentric weights, interpolation. numpy and scipy only."""
