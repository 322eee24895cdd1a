"""Finite elements: tetrahedra and sheets, their strains and materials."""
