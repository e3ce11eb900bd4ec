"""Planar pushbelt with contacts that open and slide, after Geier and Schindler (README.md)."""
