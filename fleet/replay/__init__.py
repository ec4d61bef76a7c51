"""Replay of a recording: its reports on a separate bus, or its raw frames through the present adapters."""
