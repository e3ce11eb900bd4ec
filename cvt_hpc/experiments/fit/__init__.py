"""Parameters found by the targets that they are to meet: candidates run as a sweep, an optimiser between."""
