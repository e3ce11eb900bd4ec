"""The ranks of a sweep: how they started, who does which runs, and when they end."""
