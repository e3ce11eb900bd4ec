"""Layouts of a planar pushbelt's arrays: fields of a row, entries of a vector, by name.

Kernels read `state[j, f.TENSION]`; the arrays are those of `belt`, a row an element.
"""

# Fields of the state of an element. Speeds are those at the middle of the last step.
# Saddle point, which is the ring line and the assumed centre of gravity [m]; running direction, a unit vector
Y, Z, HEADING_Y, HEADING_Z = range(4)
# Velocity of the saddle point [m/s], angular velocity [rad/s], velocity of the ring along its line [m/s]
U_Y, U_Z, OMEGA, V = range(4, 8)
# Ring up to the next element: unstretched length [m], tension [N]; its normal force on the element [N]
LENGTH, TENSION, SADDLE = range(8, 11)
# Contact forces to the next element, at rocking edge and head; that of its hole on the nose, inwards [N]
EDGE, HEAD, NOSE = range(11, 14)
# At each of the two flanks: normal force [N]; sliding speed along the meridian of the sheave, outwards, and
# in the direction of rotation, element over sheave [m/s]; friction forces against these speeds [N]
FLANK, FLANK_SLIP_M, FLANK_SLIP_T, FLANK_FRICTION_M, FLANK_FRICTION_T = range(14, 19)
# Sliding speed of the ring over the saddle, forwards [m/s]; friction force of the element against that [N]
RING_SLIP, RING_FRICTION = range(19, 21)
# Directions of friction as the Newton iteration has them, at most 1 in size
RING_DUAL, FLANK_DUAL_M, FLANK_DUAL_T = range(21, 24)
V_FILTERED = 24  # sliding speed at which the friction law of the flanks is read [m/s]
DRIVEN = 25  # 1 where the nearer pulley is the driven one, else 0
SPREAD = 26  # deflection of a sheave beyond its bedding, along the flank's normal [m]
BENDING = 27  # energy of the ring's bending up to the next element [J]
CHANGE = 28  # 4: of the speeds in the last step, from which the next one starts
CHANGE_Y, CHANGE_Z, CHANGE_W, CHANGE_V = range(CHANGE, CHANGE + 4)
STATE_FIELDS = CHANGE + 4

POINTS = 1  # of a flank

# Entries of the state of the pulleys
DRIVING_SPEED, DRIVEN_SPEED, DRIVING_RADIUS, DRIVEN_RADIUS = range(4)

# Entries of the inputs, at the start and at the end of a call
IN_SPEED, IN_DRIVING_THRUST, IN_DRIVEN_THRUST, IN_LOAD, IN_DRIVING_SHIFT = range(5)
INPUTS = IN_DRIVING_SHIFT + 1

# Entries of the totals: time [s], and sums over it [J]
# Works of the driving shaft, against the load, and that what holds the sheaves takes up as they move
TIME, WORK_IN, WORK_OUT, THRUST_WORK = range(4)
# Losses at flanks and under rings, by the rotation of elements against the ring, by transverse damping, in
# the dampers of contacts and noses between elements, of the rings along the belt, by the lag of the
# sheaves' tilt
FLANK_LOSS, RING_LOSS, DAMPING_LOSS, BELT_LOSS, ELEMENT_LOSS, STRETCH_LOSS, LAG_LOSS = range(4, 11)
# What the step damps by itself, at contacts and noses between elements and at flanks (`border`)
ELEMENT_DAMPED, FLANK_DAMPED = range(11, 13)
POWER_RESIDUAL = 13  # of the equations of motion as they were solved
GRAVITY_WORK = 14  # of the weight of elements and rings
TOTALS = 15
# Mean rates of totals from WORK_IN on, by their names in the record
POWERS = (
    "driving_power",
    "load_power",
    "thrust_power",
    "flank_loss",
    "ring_loss",
    "tilt_loss",
    "belt_loss",
    "element_loss",
    "stretch_loss",
    "lag_loss",
)
# Numerical damping of the step, by the springs and contacts where it occurs
DAMPED = {"elements": ELEMENT_DAMPED, "flanks": FLANK_DAMPED}

# Entries of the counters
STEPS, ITERATIONS, FAILED_STEPS, STATUS, FAILED_ELEMENT, FAILED_CONTACT, IN_A_ROW = range(7)
COUNTERS = 7
# values of STATUS
CONVERGED, NOT_CONVERGED, NOT_FINITE = range(3)
# values of FAILED_CONTACT
CONTACTS = ("edge", "head", "flank", "ring", "nose")

# Fields of Workspace.step
# Saddle point and running direction at q*
PREDICTED_Y, PREDICTED_Z, PREDICTED_HEADING_Y, PREDICTED_HEADING_Z = range(4)
T_Y, T_Z = range(4, 6)  # direction of the ring at an element
# Direction of the tension at this element and at the next one; tension at q_k and the old speeds
TENSION_I_Y, TENSION_I_Z, TENSION_J_Y, TENSION_J_Z, START_TENSION, TENSION_SLOPE = range(6, 12)
# Rate of a segment's angle by the speed difference of its ends; force of the ring's bending on an element
TURN_Y, TURN_Z, BENT_Y, BENT_Z = range(12, 16)
# Rate of the sine of the angle between element and segment by the difference of their rates; moment of the
# angle to the segment ahead, at q_k and the old speeds
ANGLE_I, ANGLE_J, START_MOMENT_I, START_MOMENT_J = range(16, 20)
# GAP: by which a contact presses, MEAN: that at mid step, both at the old speeds
EDGE_LEVER_I, EDGE_LEVER_J, EDGE_GAP, EDGE_MEAN = range(20, 24)
HEAD_LEVER_I, HEAD_LEVER_J, HEAD_GAP, HEAD_MEAN = range(24, 28)
NORMAL_Y, NORMAL_Z = range(28, 30)  # across the path: of the strand, or radial
# Radial direction at the flank's contact point, at q_k and at mid step
R_Y, R_Z, R_LEVER, T_LEVER = range(30, 34)
MID_R_Y, MID_R_Z, MID_R_LEVER, MID_T_LEVER, MID_RADIUS = range(34, 39)
DEPTH = 39  # penetration of the flank at q_k, without opening of the sheaves
NOSE_OFFSET, NOSE_MEAN, NOSE_LEVER_I, NOSE_LEVER_J = range(40, 44)
LAST_SPREAD = 44  # SPREAD of the step before [m]
DIAGONAL = 45  # 4 x 4 blocks of the linear laws, by columns: of an element, and of it with the next one
LINK = DIAGONAL + 16
STEP_FIELDS = LINK + 16

# Fields of Workspace.iterate
# Tension; moments of the angle to the segment ahead, on this element and on the next one
ITERATE_TENSION, MOMENT_I, MOMENT_J = range(3)
# Sums over both contacts: force, force times lever on this element and on the next one; the same of slopes:
# 1, levers, and products of levers
CONTACT, CONTACT_I, CONTACT_J = range(3, 6)
STIFF, STIFF_I, STIFF_J, STIFF_II, STIFF_IJ, STIFF_JJ = range(6, 12)
FORCE_R, FORCE_T = range(12, 14)  # of both flanks, in radial and in circumferential direction
DRIVEN_R, DRIVEN_T = range(14, 16)  # increase of both forces by the driven pulley's speed
# Decrease of both forces by the opening of the sheaves, and of the normal force by it
OPENING_R, OPENING_T, OPENING_N = range(16, 19)
RING_SLOPE = 19  # decrease of the ring's friction by its slip
NOSE_SLOPE = 20
# Gaps by which both contacts press, offset of the nose, penetration of the flanks [m]
EDGE_REACHED, HEAD_REACHED, NOSE_REACHED, DEPTH_REACHED = range(21, 25)
RESIDUAL = 25  # 4: of an element's equations
SLOPE_R, SLOPE_T = range(29, 35, 3)  # 3 each: decrease of FORCE_R and of FORCE_T by U_Y, U_Z, OMEGA
ITERATE_FIELDS = SLOPE_T + 3

# An element's equations and unknowns, the changes of U_Y, U_Z, OMEGA and V: rows, and the entries of a block
# by columns, named by row and column. A row of `Workspace.blocks` (`solvers.linked_blocks`) begins with the
# element's own block and that of its link to the next one.
ROW_Y, ROW_Z, ROW_W, ROW_V = range(4)
UNKNOWNS = 4
YY, ZY, WY, VY, YZ, ZZ, WZ, VZ, YW, ZW, WW, VW, YV, ZV, WV, VV = range(UNKNOWNS**2)
LINKED = UNKNOWNS**2
