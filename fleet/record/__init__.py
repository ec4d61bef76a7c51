"""Recorder of the bus into MCAP files, which Foxglove opens."""
