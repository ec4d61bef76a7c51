"""Replaying a recording: its reports on a bus of its own, or its raw frames through today's adapters."""
