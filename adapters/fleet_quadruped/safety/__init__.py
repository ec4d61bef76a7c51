"""Safety rules of the body: pure tables and functions, evaluated in every cycle."""
