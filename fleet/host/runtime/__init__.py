"""Machinery of a process: periodic calls, threads, cancellation, watchdog, shutdown."""
