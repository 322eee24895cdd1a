"""Contact of cages with rigid obstacles: signed distances, and the energy of one-sided springs."""
