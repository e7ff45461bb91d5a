"""Captures made up: a frame that sags, struts that are missing, silhouettes, and the exact truth of every curve."""
