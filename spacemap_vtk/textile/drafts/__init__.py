"""Drafts: drawdowns, classical patterns and their names, the loom."""
