"""Layouts of the elastic belt's arrays of lanes: constants, scalars, stations and cells, by name."""

from cvt_hpc.models.elastic_belt import fields as f

# Constants of each lane, in SI units, and from FIRST_LAW on those of the laws; `lane_belt` computes what is
# not in `Belt`.
ELEMENT_STIFFNESS, RING_STIFFNESS, ELEMENT_DAMPING, RING_DAMPING = range(4)
ELEMENT_MASS, RING_MASS, RING_RELIEF, MASS, BELT_SPEED, TRANSVERSE_DAMPING, BENDING_STIFFNESS = range(4, 11)
RING_OFFSET, RING_FRICTION, RING_FRICTION_SPEED = range(11, 14)
FRICTION_SPEED, KINETIC_FRICTION, FRICTION_GRADIENT, LAW_SPEED, SINE, COSINE, WEDGE = range(14, 21)
FORGET, DRIVING_RADIUS, DRIVEN_RADIUS, DRIVING_SPEED = range(21, 25)
DRIVING_POSITION, DRIVEN_INERTIA, AXIAL_DAMPING, THRUST, RATIO, LOAD, LOAD_START, START_SHARE = range(25, 33)
COLUMN_STIFFNESS, OUTER_EDGE, INNER_EDGE, TILT_SPRING, TILT_DAMPER, FIRST_LAW = range(33, 39)
CONSTANTS = (*f.names_from("ELEMENT_STIFFNESS", globals())[:FIRST_LAW], *f.LAWS)

# Scalars of the state, of each lane, double in any precision: the driven pulley's two, the work of the
# layers' dampers until it is read [J], how often friction was found to reverse sliding in a step, and
# from f.FIRST_STATE on the further states of free pulleys.
SPEED, POSITION, LAYER_WORK, REPEATS = range(f.FIRST_STATE)
SCALARS = f.FIRST_STATE + f.STATES

# Of the column, in `LaneState.column`: of the stations the deviation of curvature from the path's [1/m], its
# change within a step, and the moment [N m]; of the cells -P / EA, its slopes with the strain and with the
# curvature at both ends [m], its change within a step by turning, the moments of both halves times their
# content [N m^2], and the energy per content [N].
DEVIATION, TURNING, COLUMN_MOMENT, PRESSED, GIVE, TURN_NEAR, TURN_FAR, SHIFT = range(8)
BEARING_NEAR, BEARING_FAR, COLUMN_ENERGY = range(8, 11)
FIELDS_OF_COLUMN = COLUMN_ENERGY + 1

# Of elements that tilt, in `LaneState.tilt`: the angle [rad], friction of the saddle on the rings [N/m], its
# slope with the sliding [N s/m^2], the rate of the angle of an element [rad/s].
ANGLE, DRAG, DRAG_SLOPE, TURN = range(4)
FIELDS_OF_TILT = TURN + 1

# Of a state, by `derive`: axial line force, and the share of the cell behind it that is in contact; strains
# of the cells, 1 / (1 + strain) and 1 / content. By `lane_sliding`: sliding speeds, the law's coefficient,
# tanh of sliding speed over regularisation, 1 / that speed, the same tanh of rings, the elements' sliding
# speed under them.
FORCE, WAY, EPS_0, EPS_1, SHORT_0, SHORT_1, PER_CONTENT_0, PER_CONTENT_1 = range(8)
SLIDING_R, SLIDING_T, COEFFICIENT, FACTOR, PER_SPEED, RING_FACTOR, SADDLE = range(8, 15)
# By `note_speeds` in the last two steps before a sample: u, v_element and v_ring two steps ago, less twice
# those one step ago.
NOTED = 15
FIELDS_OF_FORCES = 18

# Of the fast step: increment of u, its share by that of v_element, slope w_s; of the driven pulley's stations
# (of both with free pulleys) the flanks' tangential force and its slopes
PUSH, LAG, SLOPE, FLANK, FLANK_SLOPE, FLANK_CROSS = range(FIELDS_OF_FORCES, 24)
# whether (1) linearised friction would turn the sliding of the flanks, or of the saddle, about, whether (1)
# the elements of the cell ahead of a station meet within the step, and, where they are apart, their strain at
# its end with the speeds that it begins with
REVERSING, RING_REVERSING, MEETING, AHEAD = range(24, 28)
# blocks of the system and its right side
D_00, D_01, D_11, Y_0, Y_1 = range(28, 33)
# the eliminated system: inverse pivots, the increments of v_element and v_ring, the border, the stresses'
# slopes with the speeds' differences
I_00, I_01, I_11, DV_0, DV_1, G_00, G_01, G_10, G_11, LINK_0, LINK_1 = range(33, 44)
# of motion across: line force, its slopes with the increments of u and of v_element; factors and work space
ACROSS, MASS_ACROSS, CROSS, A_00, A_01, A_11, B_00, B_01, B_10, B_11, X_0, X_1 = range(44, 56)
# of the layers' dampers in the cells of arcs, kappa h / 2 times their force [N]
BENT = 56
FIELDS_OF_WORK = 57

# Constants of each lane; from FIRST_OFFSET on the layers' offsets, then by arc and surface the factors of the
# layer above it and of the one below.
LAYER_MASS, LAYER_STIFFNESS, LAYER_DAMPING, LAYER_RELIEF, STATIC_EXCESS, PER_STRIBECK, PER_WIDTH = range(7)
SADDLE_FRICTION_LEVEL, LAYER_FRICTION_LEVEL, STRESS_RATE, DAMPING_RATE, FIRST_OFFSET = range(7, 12)
