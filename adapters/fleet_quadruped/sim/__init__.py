"""A simulated dog: twelve drives that speak the real frames, on a body with physics."""
