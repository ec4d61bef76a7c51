"""Requests to robots: decoding, receipts, actions, and the record of who asked for what."""
