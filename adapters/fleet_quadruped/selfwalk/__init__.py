"""Self-walking machines: they receive a velocity, report their state, and have a gait of their own."""
