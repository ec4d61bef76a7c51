"""Requests to robots: decoding, receipts, actions, and the history of requests."""
