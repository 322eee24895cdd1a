"""The plots: motion of picked points, energies, frequency response and reactions."""
