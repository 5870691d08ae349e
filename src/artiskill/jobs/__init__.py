"""Work on several processes, or on several machines."""
