"""Global vectors: networks, VLAD, and both side by side."""
