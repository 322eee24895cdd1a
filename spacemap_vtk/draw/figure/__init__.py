"""Make pages for publications: figures, drafts, sections, plots, contact sheets."""
