"""Privileged controllers: they read the snapshot and the object's handles, and act as any policy does."""
