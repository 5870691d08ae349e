"""A page to browse objects, contact sheets of them, and statistics over their splits."""
