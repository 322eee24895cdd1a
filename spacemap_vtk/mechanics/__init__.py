"""Mechanics of a cage: modes, response, equilibrium and time steps. numpy and scipy only."""
