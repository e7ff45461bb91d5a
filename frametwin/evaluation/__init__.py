"""How far a twin is from the truth: distances between curves, both ways, at joints, and at equal parameter."""
