"""Where a model lies in the world."""
