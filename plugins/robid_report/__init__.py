"""Report: results as one self-contained page."""
