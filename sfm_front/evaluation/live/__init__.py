"""How long a photo that arrives in a watched folder waits for its pose."""
