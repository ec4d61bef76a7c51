"""The process's own machinery: periodic calls, threads, cancellation, watchdog, shutdown."""
