"""The command line: thin, one file per command; what a command needs is imported when it runs."""
