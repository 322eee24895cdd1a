"""Tetrahedral cages: lattices, carved lattices, split cells, fTetWild. No VTK."""
