"""The public functions that are more convenient than what they call; ``import frametwin`` hands them out."""
