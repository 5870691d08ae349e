"""Policies to numbers: run episodes, count, report, record."""
