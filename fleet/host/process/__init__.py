"""One process with robots: its robots, its stop handling, its claims on twins, its services."""
