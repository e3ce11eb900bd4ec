"""A small study of the toy model, and what makes a trace of it."""

TRACED = ("--set", "design.kind=trace", "--set", "design.first_spacing=2")
GRID = """[scene]
thrust = "20 kN"
[axes]
load = { from = 0, to = 100, step = 25 }
sheave_stiffness = [1, 3]
"""
