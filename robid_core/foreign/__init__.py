"""Files of others, read in a process of their own: whatever a damaged one does to a library, it does there."""

from robid_core.foreign.reader import GuardedReader, guarded_reader

__all__ = ["GuardedReader", "guarded_reader"]
