"""Pages for publications: figures, drafts, sections, plots, contact sheets."""
