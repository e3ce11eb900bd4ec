"""Statements of papers on figures, as checks that are measured in studies: `figures.py` lists the jobs."""
