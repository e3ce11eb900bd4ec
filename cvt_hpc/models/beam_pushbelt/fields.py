"""Layouts of the arrays of a pushbelt on a ring of beams, beside those of `pushbelt.fields`."""

from cvt_hpc.models.pushbelt import fields as f

# Elements: place on the ring, length without load from the first node on [m], and its rate [m/s]; impulses of
# friction in the last step [N s]: on the ring along its line, on the element at each flank along the meridian
# and in the direction of rotation
PLACE, PLACE_RATE, RING_IMPULSE, FLANK_IMPULSE_M, FLANK_IMPULSE_T = range(f.STATE_FIELDS, f.STATE_FIELDS + 5)
FIELDS = f.STATE_FIELDS + 5

# Rows of Workspace.rows (`rcm.line_point`), at the start of a step and at its middle
ALONG, ACROSS, MID_ALONG, MID_ACROSS = range(4)
ROWS = 4

# Workspace.step: tangent (T_Y, T_Z) of the ring, whose normal is (-T_Z, T_Y), at the start and at mid step;
# |dr/ds| there; cosine and tangent of the angle between both tangents
T_Y, T_Z, MID_T_Y, MID_T_Z, MID_STRETCH, COSINE, TANGENT = range(7)
# direction from the pulley's shaft to the flank's contact point, and levers (`pushbelt.chain.radial`)
R_Y, R_Z, R_LEVER, T_LEVER, MID_R_Y, MID_R_Z, MID_R_LEVER, MID_T_LEVER, MID_RADIUS = range(7, 16)
# velocity before the step in the directions of its start [m/s], and impulses on the element but for that of
# the bilateral contact [N s]; angular velocity after the step [rad/s]
FREE_T, FREE_N, IMPULSE_T, IMPULSE_N, SPIN = range(16, 21)
# speeds of the ring at the element in the directions of mid step, after the step, and with the friction of
# the last step [m/s]; impulse of the bilateral contact with the latter [N s]
RING_ACROSS, RING_ALONG, FREE_ACROSS, FREE_ALONG, FREE_SADDLE = range(21, 26)
# largest impulse of friction at a flank [N s]; steps of the proximal points [kg]
FLANK_BOUND, RING_STEP, FLANK_STEP = range(26, 29)
STEP_FIELDS = 29
