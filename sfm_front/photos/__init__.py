"""A folder → decoded photos and their cameras."""
