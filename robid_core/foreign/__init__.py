"""Files of others, read in a process of their own: whatever a damaged one does to a library, it does there."""

from robid_core.foreign.bag import BAG_READER, files_of, is_bag, is_recording
from robid_core.foreign.reader import GuardedReader, guarded_reader

__all__ = ["BAG_READER", "GuardedReader", "files_of", "guarded_reader", "is_bag", "is_recording"]
