"""Algebra without physics: systems of equations with a structure that the models share."""
