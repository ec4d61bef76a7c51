"""Worker processes: started and watched here, reached over the bus."""
