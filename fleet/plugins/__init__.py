"""Adapters by name: installed packages and drop-in files, and the process that inspects drop-in files."""
