"""A simulated MAVLink vehicle, ArduPilot or PX4 flavour, on a real UDP port."""
