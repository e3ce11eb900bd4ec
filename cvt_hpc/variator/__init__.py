"""Common parts of the models of a whole variator: settings, courses, gross slip, verdict, record, history."""

STRANDS = ("t1", "t2")  # t1 leaves the driving pulley
PULLEYS = ("driving", "driven")
GROSS_SLIP = 0.05  # of the belt's speed: beyond, a pulley slips grossly
# of the driven pulley's speed without slip: below, under a load, and above, under one that drives, the belt
# slips through, and the run ends
LEAST_SPEED, MOST_SPEED = 0.5, 1.5
# of the distance of the shafts: a belt that is further off its path has left its grooves
LARGEST_DISPLACEMENT = 2 / 31
