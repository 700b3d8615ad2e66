"""YAML files that people write (pipelines, robots): values with places, guards, every mistake told at once."""
