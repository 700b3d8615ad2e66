"""Acquisition: from drives (simulated in memory, or any registered way to the motors), or from a recording."""
