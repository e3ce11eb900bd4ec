"""Forecast of the time of a sweep, and of the resources to request on a cluster."""
