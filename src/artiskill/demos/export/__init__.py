"""Training files in the formats of other libraries."""
