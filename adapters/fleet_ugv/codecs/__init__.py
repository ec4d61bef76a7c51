"""Codecs of serial bases, without I/O: received bytes to events, requests to bytes."""
