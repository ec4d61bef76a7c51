"""One robot: its controller, executor, navigator, adapter, and the checks around its motion."""
