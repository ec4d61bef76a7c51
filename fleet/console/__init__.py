"""The console: a web page with the fleet, served by a separate process that is a client of the bus."""
