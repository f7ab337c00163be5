"""What a run did, as values, JSON and text."""
