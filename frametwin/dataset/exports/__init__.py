"""The formats in which datasets are handed on: a folder for each sample, or files for learning that hold many."""
