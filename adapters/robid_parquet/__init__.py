"""Recordings in Parquet files, read as named arrays; needs the extra `formats` (pyarrow)."""
