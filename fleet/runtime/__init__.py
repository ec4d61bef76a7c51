"""Common base of all fleet processes: event loop, exception barrier, counters, decoders."""
