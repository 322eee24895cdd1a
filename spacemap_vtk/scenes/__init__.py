"""Scenes: read, check, connected to a pipeline; their figures."""
