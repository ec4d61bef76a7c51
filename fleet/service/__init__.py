"""An edge as a service of systemd: its unit, the rules of its devices, and their installation."""
