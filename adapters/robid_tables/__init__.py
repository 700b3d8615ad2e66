"""Recordings in tables: CSV text, MATLAB files (up to v7) and NumPy archives, read as named arrays."""
