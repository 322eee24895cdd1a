"""The plots: motion of picked points, energies and frequency response."""
