"""The judges' networks and their training: torch on arrays, knows nothing of bench."""
