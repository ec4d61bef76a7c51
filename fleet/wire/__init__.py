"""Conversion between Cyberwave's messages and the model: pure functions, no I/O, no clock.

All input is untrusted: a decoder either returns a model value or raises ``WireError`` with the position and
the reason. The wire's own conventions (signs, component orders, units) are converted here and nowhere else.
"""
