"""The draft tab: view and editor of threading, tie-up, treadling and drawdown."""
