"""How much is registered when photos are few, or arrive in another order."""
