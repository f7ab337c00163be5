"""How long a cluster would take, by a discrete simulation over tasks that were measured."""
