"""Datasets: recipes, samples that are captures with exact truth, and runs that can be killed and go on."""
