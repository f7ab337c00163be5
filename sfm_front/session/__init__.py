"""One photo's path from file to model."""
