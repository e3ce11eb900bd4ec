"""Layouts of a planar pushbelt's arrays: fields of a row, entries of a vector, by name.

Kernels read `state[j, f.TENSION]`; the arrays are those of `belt`, a row an element.
"""

# Fields of the state of an element. Speeds are those at the middle of the last step.
(
    Y,  # saddle point, which is the ring line and the assumed centre of gravity [m]
    Z,
    HEADING_Y,  # running direction of the element, a unit vector
    HEADING_Z,
    U_Y,  # velocity of the saddle point [m/s]
    U_Z,
    OMEGA,  # angular velocity [rad/s]
    V,  # velocity of the ring's material along its line [m/s]
    LENGTH,  # unstretched length of the ring up to the next element [m]
    TENSION,  # of the ring up to the next element [N]
    SADDLE,  # normal force of the ring on the element [N]
    EDGE,  # contact forces to the next element, at rocking edge and head [N]
    HEAD,
    NOSE,  # force of the next element's hole on the nose, inwards [N]
    FLANK,  # normal force at each of the two flanks [N]
    FLANK_SLIP_M,  # sliding speed along the meridian of the sheave, outwards [m/s]
    FLANK_SLIP_T,  # sliding speed in the direction of rotation, element over sheave [m/s]
    FLANK_FRICTION_M,  # friction force at each flank against these speeds [N]
    FLANK_FRICTION_T,
    RING_SLIP,  # of the ring over the saddle, forwards [m/s]
    RING_FRICTION,  # friction force of the element against that [N]
    RING_DUAL,  # directions of friction as the Newton iteration has them, at most 1 in size
    FLANK_DUAL_M,
    FLANK_DUAL_T,
    V_FILTERED,  # sliding speed at which the friction law of the flanks is read [m/s]
    DRIVEN,  # 1 where the nearer pulley is the driven one, else 0
    SPREAD,  # deflection of a sheave beyond its bedding, along the flank's normal [m]
    BENDING,  # energy of the ring's bending up to the next element [J]
    CHANGE,  # 4: of the speeds in the last step, from which the next one starts
) = range(29)
CHANGE_Y, CHANGE_Z, CHANGE_W, CHANGE_V = range(CHANGE, CHANGE + 4)
STATE_FIELDS = CHANGE + 4

POINTS = 1  # of a flank

# Entries of the state of the pulleys
DRIVING_SPEED, DRIVEN_SPEED, DRIVING_RADIUS, DRIVEN_RADIUS = range(4)

# Entries of the inputs, at the start and at the end of a call
IN_SPEED, IN_DRIVING_THRUST, IN_DRIVEN_THRUST, IN_LOAD, IN_DRIVING_SHIFT = range(5)
INPUTS = IN_DRIVING_SHIFT + 1

# Entries of the totals: time, and sums over it
(
    TIME,  # [s]
    WORK_IN,  # of the driving shaft [J]
    WORK_OUT,  # against the load [J]
    THRUST_WORK,  # that what holds the sheaves takes up as they move [J]
    FLANK_LOSS,  # [J]
    RING_LOSS,  # [J]
    DAMPING_LOSS,  # of the rotation of elements against the ring [J]
    BELT_LOSS,  # of the transverse damping [J]
    ELEMENT_LOSS,  # of the dampers of contacts and noses between elements [J]
    STRETCH_LOSS,  # of the rings' damper along the belt [J]
    LAG_LOSS,  # of the lag of the sheaves' tilt [J]
    ELEMENT_DAMPED,  # by the step itself, at contacts and noses between elements (`border`) [J]
    FLANK_DAMPED,  # at flanks [J]
    POWER_RESIDUAL,  # of the equations of motion as they were solved [J]
    GRAVITY_WORK,  # of the weight of elements and rings [J]
) = range(15)
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
DAMPED = {  # numerical damping of the step, by the springs and contacts where it occurs
    "elements": ELEMENT_DAMPED,
    "flanks": FLANK_DAMPED,
}

# Entries of the counters
STEPS, ITERATIONS, FAILED_STEPS, STATUS, FAILED_ELEMENT, FAILED_CONTACT, IN_A_ROW = range(7)
COUNTERS = 7
# values of STATUS
CONVERGED, NOT_CONVERGED, NOT_FINITE = range(3)
# values of FAILED_CONTACT
CONTACTS = ("edge", "head", "flank", "ring", "nose")

# Fields of Workspace.step
(
    PREDICTED_Y,  # saddle point and running direction at q*
    PREDICTED_Z,
    PREDICTED_HEADING_Y,
    PREDICTED_HEADING_Z,
    T_Y,  # direction of the ring at an element
    T_Z,
    TENSION_I_Y,  # direction of the tension at this element and at the next one
    TENSION_I_Z,
    TENSION_J_Y,
    TENSION_J_Z,
    START_TENSION,  # at q_k and the old speeds
    TENSION_SLOPE,
    TURN_Y,  # rate of the angle of a segment by the speed difference of its ends
    TURN_Z,
    BENT_Y,  # force of the ring's bending on an element
    BENT_Z,
    ANGLE_I,  # rate of the sine of the angle between element and segment by the difference of their rates
    ANGLE_J,
    START_MOMENT_I,  # of the angle to the segment ahead, at q_k and the old speeds
    START_MOMENT_J,
    EDGE_LEVER_I,
    EDGE_LEVER_J,
    EDGE_GAP,  # by which it presses, and the one at mid step, both at the old speeds
    EDGE_MEAN,
    HEAD_LEVER_I,
    HEAD_LEVER_J,
    HEAD_GAP,
    HEAD_MEAN,
    NORMAL_Y,  # across the path: of the strand, or radial
    NORMAL_Z,
    R_Y,  # radial direction at the flank's contact point, at q_k
    R_Z,
    R_LEVER,
    T_LEVER,
    MID_R_Y,  # and at mid step
    MID_R_Z,
    MID_R_LEVER,
    MID_T_LEVER,
    MID_RADIUS,
    DEPTH,  # penetration of the flank at q_k, without opening of the sheaves
    NOSE_OFFSET,
    NOSE_MEAN,
    NOSE_LEVER_I,
    NOSE_LEVER_J,
    LAST_SPREAD,  # SPREAD of the step before [m]
    DIAGONAL,  # 4 x 4 blocks of the linear laws, by columns: of an element, and of it with the next one
) = range(46)
LINK = DIAGONAL + 16
STEP_FIELDS = LINK + 16

# Fields of Workspace.iterate
(
    ITERATE_TENSION,
    MOMENT_I,  # of the angle to the segment ahead, on this element and on the next one
    MOMENT_J,
    CONTACT,  # sums over both contacts: force, force times lever on this element and on the next one
    CONTACT_I,
    CONTACT_J,
    STIFF,  # the same of slopes: 1, levers, and products of levers
    STIFF_I,
    STIFF_J,
    STIFF_II,
    STIFF_IJ,
    STIFF_JJ,
    FORCE_R,  # of both flanks, in radial and in circumferential direction
    FORCE_T,
    DRIVEN_R,  # increase of both forces by the driven pulley's speed
    DRIVEN_T,
    OPENING_R,  # decrease of both forces by the opening of the sheaves
    OPENING_T,
    OPENING_N,  # decrease of the normal force by it
    RING_SLOPE,  # decrease of the ring's friction by its slip
    NOSE_SLOPE,
    EDGE_REACHED,  # gaps by which both contacts press, offset of the nose, penetration of the flanks [m]
    HEAD_REACHED,
    NOSE_REACHED,
    DEPTH_REACHED,
) = range(25)
RESIDUAL = 25  # 4 fields: of an element's equations
SLOPE_R = RESIDUAL + 4  # 3 fields: decrease of FORCE_R by U_Y, U_Z, OMEGA
SLOPE_T = SLOPE_R + 3  # 3 fields
ITERATE_FIELDS = SLOPE_T + 3

# An element's equations and unknowns, the changes of U_Y, U_Z, OMEGA and V: rows, and the entries of a block
# by columns, named by row and column. A row of `Workspace.blocks` (`solvers.linked_blocks`) begins with the
# element's own block and that of its link to the next one.
ROW_Y, ROW_Z, ROW_W, ROW_V = range(4)
UNKNOWNS = 4
(
    YY,
    ZY,
    WY,
    VY,
    YZ,
    ZZ,
    WZ,
    VZ,
    YW,
    ZW,
    WW,
    VW,
    YV,
    ZV,
    WV,
    VV,
) = range(UNKNOWNS**2)
LINKED = UNKNOWNS**2
