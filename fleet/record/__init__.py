"""Recording what happens on the bus into MCAP files, which Foxglove opens."""
