"""From demonstrations to training files: other observations, another control mode, fewer points."""
