"""Yarns as surfaces: axes, sections, patches, and the clearance between them."""
