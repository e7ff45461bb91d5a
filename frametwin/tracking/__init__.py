"""A twin that follows pictures as they come, and tells what happens to the print meanwhile."""
