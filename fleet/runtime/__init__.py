"""What every process of the fleet runs on: event loop, exception barrier, counters, decoders."""
