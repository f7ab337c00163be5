"""Global vectors: networks, VLAD, and joins of them."""
