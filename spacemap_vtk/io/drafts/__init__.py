"""Files of drafts: WIF, DTX, WPO."""
