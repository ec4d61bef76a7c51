"""Links to robots: UDP, TCP, serial, in-memory; framing and back-off. No robot protocol is known here."""
