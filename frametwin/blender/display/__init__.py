"""Twins, prints and print jobs on screen: curves, colours and figures."""
