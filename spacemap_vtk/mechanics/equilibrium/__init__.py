"""Energy terms, and the equilibrium under them."""
