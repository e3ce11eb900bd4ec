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
POSITION = 0  # 3: middle of the saddle line, which is the ring line and the assumed centre of gravity [m]
HEADING = 3  # 3: running direction x of the element, a unit vector
OUTWARD = 6  # 3: its outward direction o, a unit vector; a = o x x is its axial one
SLOPE = 9  # of the ring's line in the axial direction [rad]
SPEED = 10  # 8: velocity of that point [m/s], angular velocity [rad/s], V and SLOPE_RATE
OMEGA = SPEED + ROW_W
V = SPEED + ROW_V  # speed of the ring's material along its line [m/s]
SLOPE_RATE = SPEED + ROW_P  # [rad/s]
LENGTH = 18  # unstretched length of the ring up to the next element [m]
TENSION = 19  # of both ring packages up to the next element [N]
SADDLE = 20  # normal force of both ring packages on the element [N]
PUSH = 21  # 4: contact forces to the next element: edge left, edge right, head left, head right [N]
PIN = 25  # force of the next element's hole on the pin [N]
FLANK = 26  # 4: normal forces at the flanks: left low, left high, right low, right high [N]
FLANK_SLIP_M = 30  # 4: sliding speed along the meridian of the sheave, outwards [m/s]
FLANK_SLIP_T = 34  # 4: sliding speed in the direction of rotation, element over sheave [m/s]
FLANK_FRICTION_M = 38  # 4: friction forces against these speeds [N]
FLANK_FRICTION_T = 42  # 4
FLANK_DUAL_M = 46  # 4: directions of friction as the Newton iteration has them, at most 1 in size
FLANK_DUAL_T = 50  # 4
V_FILTERED = 54  # 4: sliding speeds at which the friction law of the flanks is read [m/s]
RING_SLIP = 58  # of the ring over the saddle, forwards [m/s]
RING_FRICTION = 59  # friction force of the element against that [N]
RING_DUAL = 60
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
    "edge left",
    "edge right",
    "head left",
    "head right",
    "pin",
    "flank left low",
    "flank left high",
    "flank right low",
    "flank right high",
    "ring",
)

# Fields of Workspace.step. Directions and levers are at q_k where not said otherwise; PREDICTED is at q*.
PREDICTED_POSITION = 0  # 3
PREDICTED_HEADING = 3  # 3
PREDICTED_OUTWARD = 6  # 3
MID_OUTWARD = 9  # 3: at mid step
MID_AXIAL = 12  # 3
RING_LINE = 15  # 6: gradient of the ring's speed over an element by velocity and angular velocity
TENSION_I = 21  # 6: direction of the tension at this element, beside 1 of V, and at the next one, beside -1
TENSION_J = 27  # 6
START_TENSION = 33
TENSION_SLOPE = 34
BENT_Y, BENT_Z = 35, 36  # force of the rings' bending in the plane on an element
CHORD_I = 37  # 3: gradient of the pitch against the segment ahead by the velocity of the next element
CHORD_J = 40  # 3: of that of the next element
TURN_I = 43  # 3: by its own angular velocity
TURN_J = 46  # 3
START_MOMENT_I = 49  # of the pitch, at q_k and the old speeds
START_MOMENT_J = 50
SHEAR = 51  # of the ring at q_k [rad]
BEND = 52  # change of its slope up to the next element at q_k [rad]
YAW = 53  # 3: gradient of yaw by angular velocity
PREDICTED_YAW = 56  # moment of the yaw spring at q_k and of its damper at the old speeds
NORMAL_Y, NORMAL_Z = 57, 58  # across the path in the plane, of the strand or radial
PUSH_LEVER_I = 59  # 12: rates of the gaps at the front by angular velocities
PUSH_LEVER_J = 71  # 12
PUSH_GAP = 83  # 4: gaps by which elements press, at the old speeds; PUSH_MEAN: those at mid step, likewise
PIN_NORMAL = 87  # 3
PIN_LEVER_I = 90  # 3
PIN_LEVER_J = 93  # 3
PIN_GAP = 96
RADIAL = 97  # 12: e_r of the flanks' points
MID_RADIAL = 109  # 12: at mid step
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
PAIR_I = 1  # 8: forces between an element and the next one, on this one and on that one
PAIR_J = 9  # 8
STIFF = 17  # sums of the slopes of contacts at the front: 1, levers, and products of levers
STIFF_I = 18  # 3
STIFF_J = 21  # 3
STIFF_II = 24  # 6: upper half by columns
STIFF_JJ = 30  # 6
STIFF_IJ = 36  # 9: by columns
PIN_SLOPE = 45
PUSH_REACHED = 46  # 4: gaps by which contacts press [m]
PIN_REACHED = 50
FLANK_REACHED = 51  # 4
RING_SLOPE = 55  # decrease of the ring's friction by its slip
BY_NORMAL = 56  # 12: forces of the flanks' points by their normal forces
YIELD = 68  # 4: decrease of normal forces by the opening of the sheaves
SLOPE_MM, SLOPE_MT, SLOPE_TM, SLOPE_TT = range(
    72, 88, POINTS
)  # 4 each: of friction forces M, T by slips M, T
RESIDUAL = 88  # 8
TORQUE_ROW = 96  # 6: decrease of the driven pulley's torque by the speeds of an element, and by their own
TORQUE_OWN = 102  # by the speed of the pulley,
TORQUE_OPENING = 103  # and by the opening of the sheaves
NORMAL_ROW = 104  # 6: decrease of a flank's axial force by the speeds of an element,
NORMAL_YIELD = 110  # and by the opening of the sheaves
ITERATE_FIELDS = 111

# Fields of the state with two flows behind those of one flow; the first is the change of w in the last step
CHANGE_OF_HALF = CHANGE + ROW_HALF
HALF_SPEED = STATE_FIELDS + 1  # w, half of the right package's speed less the left one's [m/s]
HALF_LENGTH = HALF_SPEED + 1  # half of the right package's unstretched length less the left one's [m]
TENSION_DIFFERENCE = HALF_LENGTH + 1  # D, the right package's tension less the left one's [N]
HALF_SLIP = TENSION_DIFFERENCE + 1  # delta, half of the right package's slip less the left one's [m/s]
FRICTION_DIFFERENCE = HALF_SLIP + 1  # of the elements on the right package, less that on the left one [N]
SADDLE_RIGHT, SADDLE_LEFT = FRICTION_DIFFERENCE + 1, FRICTION_DIFFERENCE + 2  # normal forces of each [N]
DUAL_RIGHT, DUAL_LEFT = SADDLE_LEFT + 1, SADDLE_LEFT + 2
WIDE_STATE_FIELDS = DUAL_LEFT + 1

# Fields of Workspace.step behind those of one flow. Directions have six numbers, by velocity and angular
# velocity; beside them laws of both packages together have 1 of v, and laws of their difference 1 of w.
SLIP_BY = STEP_FIELDS  # gradient of sigma, and of delta
HALF_SLIP_BY = SLIP_BY + 6
DIFFERENCE_I = (
    HALF_SLIP_BY + 6
)  # direction of D at this element, and at the next one, where D acts against it
DIFFERENCE_J = DIFFERENCE_I + 6
TENSION_BEHIND = DIFFERENCE_J + 6  # of the element behind TENSION_J
DIFFERENCE_BEHIND = TENSION_BEHIND + 6  # and DIFFERENCE_J
START_DIFFERENCE = DIFFERENCE_BEHIND + 6
CROSS_SLOPE = START_DIFFERENCE + 1  # of T by D's direction and of D by T's; TENSION_SLOPE is their own
WIDE_STEP_FIELDS = CROSS_SLOPE + 1

# Fields of Workspace.iterate behind those of one flow
ITERATE_DIFFERENCE = ITERATE_FIELDS
SLOPE_DIFFERENCE = ITERATE_DIFFERENCE + 1  # RING_SLOPE is the sum of both packages' slopes
HALF_RESIDUAL = SLOPE_DIFFERENCE + 1  # of the equation of w
WIDE_ITERATE_FIELDS = HALF_RESIDUAL + 1


def vector(first: int) -> slice:
    """The three fields of a vector."""
    return slice(first, first + 3)
