"""Is an object fit for the benchmark? One file per question; `runner` asks all of them, of many objects."""
