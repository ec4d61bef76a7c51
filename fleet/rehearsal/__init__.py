"""Rehearsals: a mission carried out by simulated robots, in simulated time, in a process without a bus."""
