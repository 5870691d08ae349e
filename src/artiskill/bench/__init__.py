"""How fast environments step, with the bare engine's speed beside every figure."""
