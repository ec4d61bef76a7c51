"""Cyberwave's words to and from the model: pure functions, no I/O, no clock.

Everything that comes in is untrusted: a decoder returns a model value or raises ``WireError`` with the
place and the reason, and nothing else. The wire's own habits (signs, orders, units) end here.
"""
