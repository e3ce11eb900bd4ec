"""What models of a whole variator share: a job's settings, courses of load and speed, variables."""

STRANDS = ("t1", "t2")  # t1 leaves the driving pulley
PULLEYS = ("driving", "driven")
