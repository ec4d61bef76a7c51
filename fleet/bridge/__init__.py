"""Between bus and cloud: what crosses, translated, how often, and what is dropped first."""
