"""Draw large cloths and parts of them at the level of detail that a view needs."""
