"""Demonstrations: collected from experts, stored, verified, counted."""
