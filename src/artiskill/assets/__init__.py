"""Objects: from a seed or a PartNet-Mobility folder to an `ArticulatedObject`, without any engine."""
