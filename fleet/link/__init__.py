"""Ways to reach a robot: UDP, TCP, serial, memory; framing and back-off. No protocol lives here."""
