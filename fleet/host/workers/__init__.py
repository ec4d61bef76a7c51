"""Worker processes: started and monitored here, reached over the bus."""
