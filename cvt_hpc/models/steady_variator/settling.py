"""A first steady state: the belt's own transient, marched until Newton's iteration finds one from there.

Newton's iteration finds a steady state from one nearby only: which elements press, which cells are apart and
which way the rings slide on them are a thousand switches. The transient sets them as the belt itself does. It
is dissipative where friction is constant, so that it settles near enough, unless the load is more than
friction carries: then the belt slips through.
"""

import numpy as np

from cvt_hpc.models.elastic_belt import fields as f
from cvt_hpc.models.elastic_belt.belt import initial_state
from cvt_hpc.models.elastic_belt.rhs import contact_forces, fresh_contacts
from cvt_hpc.models.elastic_belt.sampling import Outcome
from cvt_hpc.models.elastic_belt.state_march import StateMarch
from cvt_hpc.models.elastic_belt.step_choice import SAFE_SHARE, transverse_limit
from cvt_hpc.models.steady_variator.equations import Equations
from cvt_hpc.models.steady_variator.newton import newton
from cvt_hpc.parameters import Parameters
from cvt_hpc.physics.sheaves import axial_element_stiffness

LONGEST_STEP = 9e-6  # [s]: the state is Newton's, the march need only come near
STIFFEST_FLANKS = 5e11  # [N/m^2]: contact stiffer than that would shorten the step; the march is without
LEAST_DAMPERS = {"transverse_damping": 500.0, "element_damping": 20.0, "ring_damping": 4.0}  # of a march
RISE = 0.02  # [s]: the load rises, the start-up's damping fades
ROUNDS, ROUNDS_A_LOOK = 6, 0.3  # of the belt: the march ends; between two tries of Newton's iteration


def settled(parameters: Parameters, equations: Equations, tolerance: float) -> np.ndarray | Outcome:
    """Return the steady unknowns, (n,), that a transient comes to, with mesh and start of the run [SI].

    Otherwise the outcome of the march, OK if it has not settled in time. `equations` are those of the belt
    under its load and with the friction that it has; `tolerance` is that of Newton's iteration.
    """
    own = axial_element_stiffness(parameters)
    softened = min(own, STIFFEST_FLANKS)
    p = {**parameters, "flank_stiffness": softened, "element_factor": 1.0}
    whole = equations.belt
    belt = whole._replace(
        bridging_stiffness=np.inf,
        rise_time=RISE,
        ramp_end=RISE,
        load_start=whole.load,
        driving=whole.driving._replace(element_stiffness=softened),
        driven=whole.driven._replace(element_stiffness=softened),
        **{key: max(least, getattr(whole, key)) for key, least in LEAST_DAMPERS.items()},
    )
    step = min(LONGEST_STEP, SAFE_SHARE * transverse_limit(p))
    around = belt.cell.sum() / belt.belt_speed
    look = max(round(ROUNDS_A_LOOK * around / step), 1)
    force = np.empty(belt.cell.size)
    softer = 1.0 / softened - 1.0 / own
    pressed_in = softer / (2.0 * np.tan(belt.half_wedge_angle))
    run = StateMarch([belt], [initial_state(p, belt)])
    run.advance(round(RISE / step), step)
    for _ in range(round(ROUNDS / ROUNDS_A_LOOK)):
        run.advance(look, step)
        if run.outcome() is not Outcome.OK:
            return run.outcome()
        state = run.state()
        contact_forces(belt, state, fresh_contacts(belt), force)
        # as far out as flanks of the belt's own stiffness carry the same force
        state.fields[f.W] += np.maximum(force, 0.0) * pressed_in
        found = newton(equations, equations.unknowns(state), tolerance, sided=False)
        if found is not None:
            return found
    return Outcome.OK
