"""Is an object fit for the benchmark? Each check is a function in `runner.CHECKS`."""
