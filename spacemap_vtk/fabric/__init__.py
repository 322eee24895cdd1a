"""The science of woven fabric: drafts, weave geometry, Bézier patches. numpy and scipy only."""
