"""Work on several processes, and files and folders that several processes may reach for."""
