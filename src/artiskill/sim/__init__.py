"""Stepping, and the `Snapshot` that everything downstream reads; the only owner of engine state."""
