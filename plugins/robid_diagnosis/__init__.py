"""Diagnosis: what the simulation gets wrong, shown against what was measured."""
