"""Vibration modes and their closed-form response. numpy and scipy only."""
