"""Benchmarks, described in ``README.md``."""
