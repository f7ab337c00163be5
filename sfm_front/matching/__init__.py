"""From descriptors to verified two-view geometries."""
