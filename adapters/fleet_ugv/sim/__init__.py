"""Simulated bases that speak the real wire on a pseudo-terminal."""
