"""Simulated quadruped: twelve drives with their real frames, on a body with physics."""
