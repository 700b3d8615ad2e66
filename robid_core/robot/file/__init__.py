"""What a robot file says: its parts, how it is read and written, names of its numbers; knows no Robot made of it."""
