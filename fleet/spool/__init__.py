"""Durable state: the spool of messages for the cloud, and its files."""
