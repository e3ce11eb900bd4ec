"""A spatial pushbelt under its thrust and load, beside the common planar one."""

import numpy as np

from cvt_hpc.models.pushbelt.start import of_lanes, start
from cvt_hpc.models.spatial_pushbelt import belt as b
from cvt_hpc.models.spatial_pushbelt.step import advance
from support import spatial_chains as chains
from support.pushbelts import SPEED, THRUST, given

NODES, STEP, TORQUE = 104, 1e-5, 60.0
LOAD = 1.35 * TORQUE
RAMP = 1500  # steps
OFFSET = 0.5e-3  # of the driven pulley along its axis [m]


def inputs(thrusts, loads, fields=b.INPUTS, drift=0.0):
    """Inputs of a call: thrust and load at its start and end."""
    found = np.zeros((2, fields))
    found[:, b.IN_SPEED] = SPEED
    found[:, b.IN_DRIVEN_THRUST], found[:, b.IN_LOAD] = thrusts, loads
    found[:, b.IN_DRIVEN_DRIFT :] = drift
    return found


def scene(offset=OFFSET, modal=(), nodes=NODES, **constants):
    """Constants, state and work space of a belt under its thrust and load, 45 ms from its start."""
    planar, planar_state = start(given(nodes, transverse_damping=0.0, modal_stiffness=modal or ((), ())))
    belt, state = chains.beside_planar(planar, planar_state, **constants)
    work = b.workspace(belt, nodes)
    for thrusts, loads, drift, steps in (
        ((500.0, THRUST), (0.0, 0.0), offset / (RAMP * STEP), RAMP),
        ((THRUST, THRUST), (0.0, LOAD), 0.0, RAMP),
        ((THRUST, THRUST), (LOAD, LOAD), 0.0, RAMP),
    ):
        assert advance(belt, b.NEWTON, state, work, inputs(thrusts, loads, drift=drift), steps, STEP) == 0
    return belt, state, work


def stored(belt, state):
    """Kinetic energy of belt and driven pulley, and that of rings, flanks and sheaves [J]."""
    energy, _, _ = chains.energy_and_momentum(belt, of_lanes(state.elements))
    pressed = of_lanes(state.elements)[:, b.FLANK : b.FLANK + 4]
    energy += np.sum(pressed**2) / belt.flank_stiffness
    energy += np.sum(belt.modal_stiffness * (state.openings**2 + state.leans**2))
    return energy + 0.5 * belt.driven_inertia * state.pulleys[b.DRIVEN_SPEED] ** 2
