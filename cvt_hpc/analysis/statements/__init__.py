"""What papers say of their figures, as checks that are measured in studies: `figures.py` lists the jobs."""
