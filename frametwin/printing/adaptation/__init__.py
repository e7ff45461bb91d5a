"""How what is still to be printed is moved to meet what stands."""
