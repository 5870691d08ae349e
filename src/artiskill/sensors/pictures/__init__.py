"""Pictures for people: objects, cameras that frame them, overlays and sheets."""
