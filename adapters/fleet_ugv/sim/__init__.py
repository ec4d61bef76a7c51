"""Simulated bases that speak the real serial protocols on a pseudo-terminal."""
