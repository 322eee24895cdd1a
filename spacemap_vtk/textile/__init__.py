"""The science of textiles: drafts, weaves, geometry, patches, crimp, rods, projects."""
