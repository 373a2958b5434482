"""How the simulated robots err: three models, and what each seed draws from them."""
