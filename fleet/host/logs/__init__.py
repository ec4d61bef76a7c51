"""Logs of an edge's processes: format, files with rotation, flood filter."""
