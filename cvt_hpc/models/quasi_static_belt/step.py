"""The model's own step: leapfrog of the dynamic coordinates, lag exactly, friction and layers implicit.

Staggered in time as `elastic_belt/imex.py`: displacements and contents at t_k, rates and speeds at t_k-1/2.
Forces are those of `rhs.accelerations`; their slopes with the speeds, that is of flank and saddle friction
and of the layers' stresses, hoop forces included, make the step linearly implicit. Other elastic forces
across the belt are explicit:

- dynamic coordinates, of inertia M: M (p' - p) / dt = force, a leapfrog;
- lagging ones: (1 - exp(-dt / T)) of the way to where they would rest, so dt q' = (1 - exp(-dt / T)) K^-1
  force, which is exact for the forces of a spring K, at any dt / T.

Both have one dense system with the slopes of friction, into which the layers' cyclic block-tridiagonal one
is eliminated (`coupled.py`). With the steady flow of eqs 29 and 30 each layer has one speed in the place of
N, and its contents follow by an implicit step of their own (`contents.py`).
"""

import numpy as np

from cvt_hpc.kernels import kernel
from cvt_hpc.models.elastic_belt import fields as f
from cvt_hpc.models.elastic_belt import rhs
from cvt_hpc.models.elastic_belt.one_system import driven_thrust, free_rates, pulled_by
from cvt_hpc.models.quasi_static_belt import fields as q
from cvt_hpc.models.quasi_static_belt.contents import settle_contents
from cvt_hpc.models.quasi_static_belt.increments import contradicts, put_forces, put_slopes, solve_increments
from cvt_hpc.models.quasi_static_belt.split_belt import Motion, SplitBelt, Work, refresh

MOST_PASSES = 9


@kernel
def march(model: SplitBelt, moved: Motion, work: Work, steps: int, noted: np.ndarray) -> bool:
    """Take some steps; False where the contact has no solution.

    `noted` (3, N) are u and the layers' speeds two steps before the end less twice those one step before.
    """
    fields = moved.state.fields
    for taken in range(steps):
        if taken >= steps - 2:
            is_first = taken == max(steps - 2, 0)
            weight = 0.0 if taken < steps - 1 else -2.0
            for k, row in enumerate((f.U, f.V_ELEMENT, f.V_RING)):
                for j in range(fields.shape[1]):
                    if is_first:
                        noted[k, j] = fields[row, j]
                    noted[k, j] += weight * fields[row, j]
        if not _step(model, moved, work):
            return False
        moved.counts[0] += 1
    return True


@kernel
def _step(model: SplitBelt, moved: Motion, work: Work) -> bool:
    belt, state = model.belt, moved.state
    rhs.accelerations(belt, state, moved.force, moved.eps, work.rate, work.moments)
    put_forces(model, moved, work)
    for attempt in range(MOST_PASSES):
        put_slopes(model, moved, work)
        solve_increments(model, moved, work)
        if not contradicts(model, moved, work):
            break
        moved.counts[1] += attempt == 0
    for row in (q.MEETING, q.REVERSING, q.RING_REVERSING):
        work.stations[row] = 0.0
    _advance(model, moved, work)
    return refresh(model, moved)


@kernel
def _advance(model: SplitBelt, moved: Motion, work: Work) -> None:
    """Apply the increments."""
    belt, state, stations, step = model.belt, moved.state, work.stations, model.step
    n, fields, scalars, columns = belt.cell.size, state.fields, state.scalars, work.layers.columns
    shapes, count, slow = model.shapes, model.shapes.shape[1], model.dynamic
    moment = taken = 0.0
    for j in range(n):
        du, dv0 = work.rate[f.U, j], columns[j, q.ELEMENT, q.RIGHT]
        if moved.force[j] > 0.0:
            slopes = stations[q.TANGENTIAL_SLOPE, j] * dv0 + stations[q.TANGENTIAL_CROSS, j] * du
            distance = belt.rise[j] + belt.upright[j] * fields[f.W, j]
            if belt.on_driven[j] > 0.0:
                moment += work.moments[j] + slopes * (belt.driven_radius + distance)
            else:
                taken += work.moments[j] - slopes * (belt.driving_radius + distance)
    for k in range(count):
        moved.p[k] += work.found[k]
    work_done = 0.0
    np.dot(model.inertia, moved.p, work.row)
    for i in range(slow, count):
        work_done += moved.p[i] * work.row[i]
    implicit = 0.0 if model.steady_flow else 1.0  # share of the change of speeds that the dampers feel
    for j in range(n):
        b, half = j + 1 if j < n - 1 else 0, 0.5 * belt.curvature[j] * belt.cell[j]
        lifted = half * (fields[f.U, j] + fields[f.U, b])
        lifts = half * (work.rate[f.U, j] + work.rate[f.U, b])
        closing = fields[f.V_ELEMENT, b] - fields[f.V_ELEMENT, j] + lifted
        change = columns[b, q.ELEMENT, q.RIGHT] - columns[j, q.ELEMENT, q.RIGHT] + lifts
        grip, eps = belt.element_damping / belt.cell[j], moved.eps[q.ELEMENT, j]
        damped = 0.0
        if work.layers.links[q.ELEMENT, j] > 0.0:
            damped = grip * (closing + implicit * change)
            if eps > 0.0:
                damped = implicit * min(belt.element_stiffness * eps + damped, 0.0)
            if grip * closing > -belt.element_stiffness * eps:
                damped = -belt.element_stiffness * min(eps, 0.0)
        work_done += damped * (closing + 0.5 * change)
        closing = fields[f.V_RING, b] - fields[f.V_RING, j] + lifted
        change = columns[b, q.RING, q.RIGHT] - columns[j, q.RING, q.RIGHT] + lifts
        damped = belt.ring_damping / belt.cell[j] * (closing + implicit * change)
        work_done += damped * (closing + 0.5 * change)
    for j in range(n):
        fields[f.V_ELEMENT, j] += columns[j, q.ELEMENT, q.RIGHT]
        fields[f.V_RING, j] += columns[j, q.RING, q.RIGHT]
    if not model.steady_flow:
        for layer in range(2):
            v, eps = fields[f.V_ELEMENT + layer], moved.eps[layer]
            first = v[0] / (1.0 + eps[n - 1])
            inflow = first
            for c in range(n):
                outflow = v[c + 1] / (1.0 + eps[c]) if c < n - 1 else first
                fields[f.N_ELEMENT + layer, c] += step / belt.cell[c] * (inflow - outflow)
                inflow = outflow
    for k in range(count):
        moved.q[k] += step * moved.p[k]
    belt_speed = rhs.speed_share_at(belt, scalars[f.TIME]) * belt.belt_speed
    np.dot(shapes, moved.p, fields[f.U])
    np.dot(shapes, moved.q, work.rate[f.W])
    last = fields[f.V_FILTERED, n - 1]
    for j in range(n):
        before = last
        last = fields[f.V_FILTERED, j]
        if belt.friction_memory > 0.0 and belt.touches[j] > 0.0:
            speed = rhs.sliding_speed(belt, state, j)
            fields[f.V_FILTERED, j] = speed
            if moved.force[j] > 0.0:
                carried, entering = rhs.transported(belt, moved.force, j, belt_speed, speed, before)
                forget = 1.0 / belt.friction_memory
                target = (carried * entering + forget * speed) / (carried + forget)
                fields[f.V_FILTERED, j] = target + (last - target) * np.exp(-(carried + forget) * step)
    for j in range(n):
        fields[f.W, j] = work.rate[f.W, j]
    if model.steady_flow:
        work_done += _settle(model, moved, work)
    if belt.pulleys.are_free:
        pull = pulled_by(belt, moved.force, work.moments)
        pull[0], pull[1] = taken, moment
        found = free_rates(belt, state, pull)
        scalars[f.DRIVEN_SPEED] += step * found[0]
        scalars[f.DRIVEN_POSITION] += step * found[1]
        for k in range(f.FIRST_STATE, scalars.size):
            scalars[k] += step * found[2 + k - f.FIRST_STATE]
    else:
        thrust = driven_thrust(belt, moved.force) - rhs.thrust_at(belt, scalars[f.TIME])
        load = belt.ratio * rhs.load_at(belt, scalars[f.TIME])
        scalars[f.DRIVEN_SPEED] += step * (moment - load) / belt.driven_inertia
        scalars[f.DRIVEN_POSITION] += step * thrust / belt.axial_damping
    scalars[f.LAYER_WORK] += step * work_done
    scalars[f.TIME] += step


@kernel
def _settle(model: SplitBelt, moved: Motion, work: Work) -> float:
    """Contents by the forces at the end of the step; the power that their drag takes [W]."""
    belt, stations, blocks = model.belt, work.stations, work.layers.diagonal
    columns, along = work.layers.columns, stations[q.ALONG : q.ALONG + q.LAYERS]
    for j in range(belt.cell.size):
        dv0, dv1, dual = columns[j, q.ELEMENT, q.RIGHT], columns[j, q.RING, q.RIGHT], belt.dual[j]
        of_element = blocks[j, q.ELEMENT_ELEMENT] - dual * belt.element_mass / model.step
        of_ring = blocks[j, q.RING_RING] - dual * belt.ring_mass[j] / model.step
        rubbed = of_element * dv0 + blocks[j, q.ELEMENT_RING] * dv1
        along[q.ELEMENT, j] -= rubbed + stations[q.CROSS_SLOPE, j] * work.rate[f.U, j]
        along[q.RING, j] -= of_ring * dv1 + blocks[j, q.ELEMENT_RING] * dv0
    return settle_contents(belt, model.drag, model.share, moved.state.fields, moved.eps, along, model.step)
