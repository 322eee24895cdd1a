"""Tetrahedral cages. numpy only."""
