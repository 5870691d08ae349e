"""What `tools/make_learning_tables.py` consists of: cells, a queue, and tables."""
