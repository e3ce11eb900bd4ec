"""How long a sweep will take, and what to ask a cluster for."""
