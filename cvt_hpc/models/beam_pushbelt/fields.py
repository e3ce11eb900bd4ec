"""Layouts of the arrays of a pushbelt on a ring of beams, beside those of `pushbelt.fields`."""

from cvt_hpc.models.pushbelt import fields as f

(
    PLACE,  # of the element on the ring, length without load from the first node on [m]
    PLACE_RATE,  # [m/s]
    RING_IMPULSE,  # of friction on the ring along its line in the last step [N s]
    FLANK_IMPULSE_M,  # on the element at each flank, along the meridian [N s]
    FLANK_IMPULSE_T,  # and in the direction of rotation
) = range(f.STATE_FIELDS, f.STATE_FIELDS + 5)
FIELDS = f.STATE_FIELDS + 5

# Entries of the counters beside those of `pushbelt.belt`, of which ITERATIONS counts sweeps
CORRECTIONS = 7  # of impulses
COUNTERS = 8

# Rows of Workspace.rows (`rcm_beam.line_point`), at the start of a step and at its middle
ALONG, ACROSS, MID_ALONG, MID_ACROSS = range(4)
ROWS = 4

# Fields of Workspace.step
(
    T_Y,  # tangent of the ring at the start of a step; its normal is (-T_Z, T_Y)
    T_Z,
    MID_T_Y,  # and at its middle
    MID_T_Z,
    MID_STRETCH,  # |dr/ds| there
    COSINE,  # of the angle between both tangents
    TANGENT,
    FREE_T,  # velocity before the step in the directions of its start [m/s]
    FREE_N,
    IMPULSE_T,  # on the element but for that of the bilateral contact [N s]
    IMPULSE_N,
    SPIN,  # angular velocity after the step [rad/s]
    RING_ACROSS,  # speeds of the ring at the element in the directions of mid step, after the step [m/s]
    RING_ALONG,
    R_Y,  # direction from the pulley's shaft to the flank's contact point, and levers (`pushbelt.chain`)
    R_Z,
    R_LEVER,
    T_LEVER,
    MID_R_Y,
    MID_R_Z,
    MID_R_LEVER,
    MID_T_LEVER,
    MID_RADIUS,
    FLANK_BOUND,  # largest impulse of friction at a flank [N s]
    RING_STEP,  # of the proximal points [kg]
    FLANK_STEP,
) = range(26)
STEP_FIELDS = 26
