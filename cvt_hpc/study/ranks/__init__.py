"""The ranks of a sweep: their start, the distribution of runs, and their end."""
