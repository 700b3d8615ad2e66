"""Where results are kept: by content, written for good or not at all, verified when read."""

from robid_core.store.entry import Entry, canonical_json, text_hash
from robid_core.store.files import OF_THE_MACHINE, Files, NoFile, failures_named
from robid_core.store.store import Lookup, State, Store

__all__ = [
    "OF_THE_MACHINE",
    "Entry",
    "Files",
    "Lookup",
    "NoFile",
    "State",
    "Store",
    "canonical_json",
    "failures_named",
    "text_hash",
]
