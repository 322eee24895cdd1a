"""Crimp interchange, tensile tests and the stiffness of cloth."""
