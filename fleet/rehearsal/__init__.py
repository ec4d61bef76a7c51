"""Rehearsals: missions executed by simulated robots, in simulated time, in a process without a bus."""
