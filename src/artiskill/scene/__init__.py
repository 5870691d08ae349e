"""Object + robot + physics -> `Scene`: a compiled model and, resolved once, where everything is in it."""
