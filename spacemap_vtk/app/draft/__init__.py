"""The draft as weavers see it: threading, tie-up, treadling and drawdown, to look at and edit."""
