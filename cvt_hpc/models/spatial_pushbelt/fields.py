"""Layouts of a spatial pushbelt's arrays: fields of a row, entries of a vector, by name.

A field that is a vector or a matrix is named by its first number; their count stands beside it.
"""

from cvt_hpc.models.pushbelt import fields as planar
from cvt_hpc.solvers.linked_blocks import field_of_right

# An element's unknowns are the changes of its velocity, angular velocity, V and SLOPE_RATE: the order of rows
# and columns of its equations. With two flows of ring material, one for each package, w comes behind them.
SIZE, WIDE = 8, 9
ROW_U, ROW_W, ROW_V, ROW_P, ROW_HALF = 0, 3, 6, 7, 8
# The parts of a block by columns, each named by its first row and its first column
ROWS = ROW_U, ROW_W, ROW_V, ROW_P
UU, WU, VU, PU, UW, WW, VW, PW, UV, WV, VV, PV, UP, WP, VP, PP = (
    row + SIZE * column for column in ROWS for row in ROWS
)
# A row of `Workspace.blocks` (`solvers.linked_blocks`) begins with the element's own block and that of its
# link to the next one. Its right sides are the residual, and those by the border's unknowns.
LINKED = SIZE**2
RIGHT = field_of_right(SIZE)
RIGHT_SPEED = RIGHT + SIZE
RIGHT_OPENINGS = RIGHT_SPEED + SIZE
WIDE_LINKED = WIDE**2
WIDE_RIGHT = field_of_right(WIDE)

AXIAL = 2  # coordinate of a vector out of the plane

# Points of an element, of which there are as many at its flanks as at the front to the next one
LEFT_LOW, LEFT_HIGH, RIGHT_LOW, RIGHT_HIGH = range(4)
EDGE_LEFT, EDGE_RIGHT, HEAD_LEFT, HEAD_RIGHT = range(4)
POINTS = 4
ON_LEFT, ON_RIGHT = range(2)

# Fields of the state of an element. Speeds are those at the middle of the last step.
# 3 each: middle of the saddle line, which is the ring line and the assumed centre of gravity [m]; running
# direction x and outward direction o of the element, unit vectors; a = o x x is its axial one
POSITION, HEADING, OUTWARD = range(0, 9, 3)
SLOPE = 9  # of the ring's line in the axial direction [rad]
SPEED = 10  # 8: velocity of that point [m/s], angular velocity [rad/s], V and SLOPE_RATE
# Of these: angular velocity, speed of the ring's material along its line, rate of SLOPE [rad/s]
OMEGA, V, SLOPE_RATE = SPEED + ROW_W, SPEED + ROW_V, SPEED + ROW_P
# Of both ring packages up to the next element: unstretched length [m]; tension, normal force on the
# element [N]
LENGTH, TENSION, SADDLE = range(18, 21)
PUSH = 21  # 4: contact forces to the next element: edge left, edge right, head left, head right [N]
PIN = 25  # force of the next element's hole on the pin [N]
# 4 each, at the flanks: left low, left high, right low, right high. Normal forces [N]; sliding speeds along
# the meridian of the sheave, outwards, and in the direction of rotation, element over sheave [m/s];
# friction forces against these [N]; directions of friction as the Newton iteration has them, at most 1 in
# size; sliding speeds at which the friction law is read [m/s]
FLANK, FLANK_SLIP_M, FLANK_SLIP_T, FLANK_FRICTION_M, FLANK_FRICTION_T = range(26, 46, POINTS)
FLANK_DUAL_M, FLANK_DUAL_T, V_FILTERED = range(46, 58, POINTS)
# Of the ring: sliding speed over the saddle, forwards [m/s]; friction force of the element against that [N]
RING_SLIP, RING_FRICTION, RING_DUAL = range(58, 61)
DRIVEN = 61  # 1 where the nearer pulley is the driven one, else 0
SPREAD = 62  # 2: deflection of the left and the right sheave beyond its bedding, along the flank's normal [m]
BENDING = 64  # energy of the rings' bending in the plane up to the next element [J]
CHANGE = 65  # 8: of the speeds in the last step, from which the next one starts
STATE_FIELDS = CHANGE + SIZE

# Entries of the state of the pulleys beside those of `pushbelt.belt`: positions of the mid planes between
# their sheaves along the axes [m]
DRIVING_MIDDLE, DRIVEN_MIDDLE = range(planar.DRIVEN_RADIUS + 1, planar.DRIVEN_RADIUS + 3)
PULLEY_FIELDS = DRIVEN_MIDDLE + 1

# Entries of the loads of the last step: axial forces that press each sheave outwards [N], and torques of the
# belt on the pulleys in the direction of rotation [N m]
DRIVING_LEFT, DRIVING_RIGHT, DRIVEN_LEFT, DRIVEN_RIGHT, DRIVING_TORQUE, DRIVEN_TORQUE = range(6)
LOADS = DRIVEN_TORQUE + 1

# Entries of the inputs beside those of `pushbelt.belt`, of which thrusts are those on the loose sheaves:
# axial speeds of the pulleys' mid planes, beside what the loose sheaves do [m/s]
IN_DRIVING_DRIFT, IN_DRIVEN_DRIFT = range(planar.INPUTS, planar.INPUTS + 2)
INPUTS = IN_DRIVEN_DRIFT + 1

# values of FAILED_CONTACT
CONTACTS = (
    *("edge left", "edge right", "head left", "head right", "pin"),
    *("flank left low", "flank left high", "flank right low", "flank right high", "ring"),
)

# Fields of Workspace.step. Directions and levers are at q_k where not said otherwise; PREDICTED is at q*.
PREDICTED_POSITION, PREDICTED_HEADING, PREDICTED_OUTWARD = range(0, 9, 3)  # 3 each
MID_OUTWARD, MID_AXIAL = range(9, 15, 3)  # 3 each: at mid step
# 6 each: gradient of the ring's speed over an element by velocity and angular velocity; direction of the
# tension at this element, beside 1 of V, and at the next one, beside -1
RING_LINE, TENSION_I, TENSION_J = range(15, 33, 6)
START_TENSION, TENSION_SLOPE = range(33, 35)
BENT_Y, BENT_Z = range(35, 37)  # force of the rings' bending in the plane on an element
# 3 each: gradient of the pitch of an element and of the next one against the segment ahead, by the velocity
# of the next element, and by their own angular velocities; moments of the pitch, at q_k and the old speeds
CHORD_I, CHORD_J, TURN_I, TURN_J = range(37, 49, 3)
START_MOMENT_I, START_MOMENT_J = range(49, 51)
# At q_k: shear of the ring, and change of its slope up to the next element [rad]
SHEAR, BEND = range(51, 53)
YAW = 53  # 3: gradient of yaw by angular velocity
PREDICTED_YAW = 56  # moment of the yaw spring at q_k and of its damper at the old speeds
NORMAL_Y, NORMAL_Z = range(57, 59)  # across the path in the plane, of the strand or radial
# 12 each: rates of the gaps at the front by angular velocities
PUSH_LEVER_I, PUSH_LEVER_J = range(59, 83, 12)
PUSH_GAP = 83  # 4: gaps by which elements press, at the old speeds; PUSH_MEAN: those at mid step, likewise
PIN_NORMAL, PIN_LEVER_I, PIN_LEVER_J = range(87, 96, 3)  # 3 each
PIN_GAP = 96
RADIAL, MID_RADIAL = range(97, 121, 12)  # 12 each: e_r of the flanks' points, and at mid step
MID_RADIUS = 121  # 4
FLANK_GAP = 125  # 4: in the plane at q_k, along the axis at q*, without opening of the sheaves
INERTIA = 129  # 6: mass of element and ring over the step, by velocities, the upper half by columns,
INERTIA_UW = 135  # 9: of velocities by angular velocities, by columns,
INERTIA_WW = 144  # 6: and by angular velocities
GYROSCOPIC = 150  # 3: moment
DIAGONAL = 153  # blocks of the linear laws: of an element,
LINK = DIAGONAL + SIZE**2  # and of it with the next one
PUSH_MEAN = LINK + SIZE**2  # 4
PIN_MEAN = PUSH_MEAN + POINTS
LAST_SPREAD = PIN_MEAN + 1  # 2: SPREAD of the step before [m]
STEP_FIELDS = LAST_SPREAD + 2

# Fields of Workspace.iterate
ITERATE_TENSION = 0
PAIR_I, PAIR_J = range(1, 17, SIZE)  # 8 each: forces to the next element, on this one and on that one
# Sums of the slopes of contacts at the front: 1, levers (3 each), and products of levers, the upper half by
# columns (6 each), STIFF_IJ by columns (9)
STIFF, STIFF_I, STIFF_J = 17, 18, 21
STIFF_II, STIFF_JJ, STIFF_IJ = range(24, 42, 6)
PIN_SLOPE = 45
# Gaps by which contacts press [m]
PUSH_REACHED, PIN_REACHED, FLANK_REACHED = 46, 50, 51  # 4, 1, 4
RING_SLOPE = 55  # decrease of the ring's friction by its slip
BY_NORMAL = 56  # 12: forces of the flanks' points by their normal forces
YIELD = 68  # 4: decrease of normal forces by the opening of the sheaves
# 4 each: of friction forces M, T by slips M, T
SLOPE_MM, SLOPE_MT, SLOPE_TM, SLOPE_TT = range(72, 88, POINTS)
RESIDUAL = 88  # 8
# Decrease of the driven pulley's torque by the speeds of an element, and by their own (6); by the speed of
# the pulley, and by the opening of the sheaves
TORQUE_ROW, TORQUE_OWN, TORQUE_OPENING = 96, 102, 103
# Decrease of a flank's axial force by the speeds of an element (6), and by the opening of the sheaves
NORMAL_ROW, NORMAL_YIELD = 104, 110
ITERATE_FIELDS = 111

# Fields of the state with two flows behind those of one flow
CHANGE_OF_HALF = CHANGE + ROW_HALF  # of w in the last step
# w, half of the right package's speed less the left one's [m/s]; the same half of the unstretched lengths
# [m]; D, the right package's tension less the left one's [N]; delta, half of the right package's slip less
# the left one's [m/s]; friction of the elements on the right package, less that on the left one [N]
(HALF_SPEED, HALF_LENGTH, TENSION_DIFFERENCE, HALF_SLIP, FRICTION_DIFFERENCE) = range(
    STATE_FIELDS + 1, STATE_FIELDS + 6
)
# Normal forces of each package [N], directions of its friction
SADDLE_RIGHT, SADDLE_LEFT, DUAL_RIGHT, DUAL_LEFT = range(STATE_FIELDS + 6, STATE_FIELDS + 10)
WIDE_STATE_FIELDS = STATE_FIELDS + 10

# Fields of Workspace.step behind those of one flow. Directions have six numbers, by velocity and angular
# velocity; beside them laws of both packages together have 1 of v, and laws of their difference 1 of w.
# 6 each: gradient of sigma, and of delta; direction of D at this element, and at the next one, where D acts
# against it; TENSION_J and DIFFERENCE_J of the element behind
(SLIP_BY, HALF_SLIP_BY, DIFFERENCE_I, DIFFERENCE_J, TENSION_BEHIND, DIFFERENCE_BEHIND) = range(
    STEP_FIELDS, STEP_FIELDS + 36, 6
)
START_DIFFERENCE = STEP_FIELDS + 36
CROSS_SLOPE = START_DIFFERENCE + 1  # of T by D's direction and of D by T's; TENSION_SLOPE is their own
WIDE_STEP_FIELDS = CROSS_SLOPE + 1

# Fields of Workspace.iterate behind those of one flow: D; difference of both packages' slopes, of which
# RING_SLOPE is the sum; residual of the equation of w
ITERATE_DIFFERENCE, SLOPE_DIFFERENCE, HALF_RESIDUAL = range(ITERATE_FIELDS, ITERATE_FIELDS + 3)
WIDE_ITERATE_FIELDS = ITERATE_FIELDS + 3


def vector(first: int) -> slice:
    """The three fields of a vector."""
    return slice(first, first + 3)
