"""The console: a web page with the fleet, served by a process of its own that is a client of the bus."""
