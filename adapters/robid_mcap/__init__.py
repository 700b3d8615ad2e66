"""MCAP logs: what an acquisition writes while it runs, and what can be read back, whole or cut."""
