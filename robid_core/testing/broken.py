"""What is raised where a plugin does not keep its contract."""

from __future__ import annotations


class ContractBroken(AssertionError):
    """A stage does not do what every stage of its kind must; the message says which clause."""
