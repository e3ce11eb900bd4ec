"""A mass on a belt at rest, which should stick."""

from support.small_systems import scene

WIDTH, MU, LOAD, MASS = 1e-3, 0.6, 2.0, 0.5
RATE = LOAD * MU / (MASS * WIDTH)  # of the decay of sliding at rest [1/s]
STUCK = scene(
    "oscillator",
    mass=MASS,
    normal_load=LOAD,
    static_friction=MU,
    friction_speed=WIDTH,
    belt_speed=0.0,
    initial_speed=1e-9,
    duration=0.2,
    sampling_rate=100.0,
)
