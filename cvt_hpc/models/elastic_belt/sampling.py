"""The recorded quantities of the belt at each sampling instant, and when a run has to be stopped.

A `march` takes many steps and samples in one call, by any of the belt's own steps.
"""

from enum import IntEnum
from fractions import Fraction
from typing import Any, NamedTuple

import numpy as np

from cvt_hpc.kernels import kernel
from cvt_hpc.lanes import LaneArray, absolute, fma, like, maximum, merge_parts, minimum, select
from cvt_hpc.models.elastic_belt import fields as f
from cvt_hpc.models.elastic_belt import lane_fields as lf
from cvt_hpc.models.elastic_belt import lane_forces as forces
from cvt_hpc.models.elastic_belt.belt import MODES, REGIONS, Mesh
from cvt_hpc.models.elastic_belt.fields import POWERS
from cvt_hpc.models.elastic_belt.lane_belt import LaneBelt, LaneState
from cvt_hpc.models.elastic_belt.lane_forces import derive, note_speeds
from cvt_hpc.models.elastic_belt.moments import MOMENTS, add
from cvt_hpc.models.elastic_belt.power import audit
from cvt_hpc.models.elastic_belt.pulley_step import opening_by_tilt
from cvt_hpc.physics import compliance
from cvt_hpc.variator import LEAST_SPEED, MOST_SPEED, PULLEYS, STRANDS

SCALARS = (
    *("load", "driven_speed", "driven_position"),
    *(f"{name} {strand}" for name in ("ring_tension", "push_force") for strand in STRANDS),
    *(f"{name} {pulley}" for name in ("axial_force", "slip", "open_share") for pulley in PULLEYS),
    *("least_strand_force", "driving_speed", "driving_position"),
    *(f"tilt {pulley}" for pulley in PULLEYS),
)


def _places(names: tuple[str, ...]) -> Any:
    """Place of each name, by the name in capitals."""
    return IntEnum("Scalar", [name.upper().replace(" ", "_") for name in names], start=0)


_Scalar = _places(SCALARS)
CHANNELS = (*SCALARS, *POWERS, "step_ripple")
_STEP_RIPPLE = CHANNELS.index("step_ripple")
PROFILES = (*MOMENTS, "contact_force", "mean_displacement")
CONTACT_FORCE, MEAN_DISPLACEMENT = range(len(MOMENTS), len(PROFILES))

LEAST_FORCE = 1e-30  # [N]: less than any wrap bears, for a quotient without force
# Of the rings, which break at 1 %, and of pressed elements; and of a cell's gap in the belt's length, as all
# the play may gather in one cell, however short that is
LARGEST_STRAIN = 0.05


class Outcome(IntEnum):
    """Why a march ended."""

    OK = 0
    NO_CONTACT_SOLUTION = 1
    NOT_FINITE = 2
    LEFT_THE_GROOVES = 3
    OVERSTRAINED = 4
    SLIPPED_THROUGH = 5
    RAN_AWAY = 6


# Where a lane's run has to be stopped for the first time, or the last one: the `Outcome`, the time [s], and
# until then the linear solves of the contact problem and the repeated solutions of friction.
ENDED = ("outcome", "time", "contact_solves", "repeats")
OUTCOME, ENDED_AT, CONTACT_SOLVES, REPEATED = range(len(ENDED))


class Sensors(NamedTuple):
    """Places at which displacement is sensed.

    Of `matrix` first the probes, then MODES sine amplitudes of each strand, measured from the chord between
    its ends.
    """

    matrix: np.ndarray  # weights of the stations' displacement, (S, N), of the lanes' precision
    begins: np.ndarray  # the first station that counts in each of them, (S,) int
    ends: np.ndarray  # the one behind the last, (S,) int
    middles: np.ndarray  # cell in the middle of each strand, (2,) int
    starts: np.ndarray  # first cell of each strand, (2,) int
    stops: np.ndarray  # the one behind its last, (2,) int
    interval: float  # of sampling [s]


class Samples(NamedTuple):
    """The arrays of samples, as kernels take them."""

    sensing: Sensors  # S rows
    rows: LaneArray  # of a sample a row, (samples, S + C) doubles: the sensors, then CHANNELS
    # (N, 23) doubles; PROFILES of each sample are added to it; one without rows takes none
    profiles: LaneArray
    ended: LaneArray  # (1, 4) doubles: ENDED of each lane


class Probe(NamedTuple):
    """A place on the path: label, that begins with the region, and path coordinate s [m]."""

    label: str
    position: float


def probes(grid: Mesh, per_strand: int, per_arc: int) -> tuple[Probe, ...]:
    """Equally spaced probes of all regions, strands first; so many in each, the region's ends excluded."""
    places = []
    for region in (1, 3, 0, 2):
        count = per_strand if region % 2 else per_arc
        start, length = grid.position[grid.starts[region]], grid.path.lengths[region]
        for k in range(1, count + 1):
            share = Fraction(k, count + 1)
            places.append(Probe(f"{REGIONS[region]} {share}", start + float(share) * length))
    return tuple(places)


def sensors(grid: Mesh, places: tuple[Probe, ...], interval: float, dtype: type) -> Sensors:
    """Weights that turn the stations' displacement into that of probes and of the strands' modes."""
    n = grid.cell.size
    ends = np.append(grid.position, grid.path.path_length)
    rows = []
    for place in places:
        row = np.zeros(n)
        j = min(int(np.searchsorted(ends, place.position, side="right")) - 1, n - 1)
        share = (place.position - ends[j]) / grid.cell[j]
        row[j], row[(j + 1) % n] = 1.0 - share, share
        rows.append(row)
    for region in (1, 3):
        first, count = grid.starts[region], grid.counts[region]
        length = grid.path.lengths[region]
        x, dual = grid.along(region)[:-1] / length, 0.5 * (grid.cell + np.roll(grid.cell, 1))
        sines = np.sin(np.pi * np.outer(np.arange(1, MODES + 1), x))
        weighted = sines * dual[first : first + count]
        # least squares by length, which is exact for these sines on any mesh
        for shape in np.linalg.solve(weighted @ sines.T, weighted):
            row = np.zeros(n)
            row[first : first + count] = shape
            row[first] -= shape @ (1.0 - x)
            row[(first + count) % n] -= shape @ x
            rows.append(row)
    starts = np.array([grid.starts[1], grid.starts[3]])
    stops = starts + np.array([grid.counts[1], grid.counts[3]])
    counting = [np.flatnonzero(row) for row in rows]
    begins = np.array([stations[0] for stations in counting])
    ends_ = np.array([stations[-1] + 1 for stations in counting])
    return Sensors(np.array(rows, dtype=dtype), begins, ends_, (starts + stops) // 2, starts, stops, interval)


@kernel
def sample(belt: LaneBelt, state: LaneState, stations: LaneArray, samples: Samples, k: int) -> None:
    """Record a state, whose results of `derive` are in `stations`, into row k of `samples`."""
    _watch(belt, state, stations, samples.ended)
    sensing, rows, profiles = samples.sensing, samples.rows, samples.profiles
    fields, c = state.fields, belt.constants
    sensed = sensing.matrix.shape[0]
    zero = like(0.0, fields[0, f.W])
    for s in range(sensed):
        total = zero
        for j in range(sensing.begins[s], sensing.ends[s]):
            total = fma(sensing.matrix[s, j], fields[j, f.W], total)
        rows[k, s] = total
    speed = state.scalars[0, lf.SPEED]
    share = forces.lane_speed_share(belt, state.time[0], zero)
    belt_speed = share * c[0, lf.BELT_SPEED]
    rows[k, sensed + _Scalar.LOAD] = forces.lane_load(belt, state.time[0], speed)
    rows[k, sensed + _Scalar.DRIVEN_SPEED] = speed
    rows[k, sensed + _Scalar.DRIVEN_POSITION] = state.scalars[0, lf.POSITION]
    element_stiffness, ring_stiffness = c[0, lf.ELEMENT_STIFFNESS], c[0, lf.RING_STIFFNESS]
    centrifugal = c[0, lf.MASS] * belt_speed * belt_speed
    least = like(np.inf, zero)
    for strand in range(2):
        middle = sensing.middles[strand]
        rows[k, sensed + _Scalar.RING_TENSION_T1 + strand] = ring_stiffness * stations[middle, lf.EPS_1]
        rows[k, sensed + _Scalar.PUSH_FORCE_T1 + strand] = maximum(
            -element_stiffness * forces.pressed_strain(belt, state, stations, middle), 0.0
        )
        for j in range(sensing.starts[strand], sensing.stops[strand]):
            net = ring_stiffness * stations[j, lf.EPS_1]
            pressed = minimum(forces.pressed_strain(belt, state, stations, j), 0.0)
            net = fma(element_stiffness, pressed, net)
            least = minimum(net, least)
    rows[k, sensed + _Scalar.LEAST_STRAND_FORCE] = least - centrifugal
    driving_speed = like(c[0, lf.DRIVING_SPEED], speed) * forces.lane_speed_share(belt, state.time[0], speed)
    rows[k, sensed + _Scalar.DRIVING_SPEED] = driving_speed + state.scalars[0, f.FIRST_STATE + f.EXCESS]
    shift = state.scalars[0, f.FIRST_STATE + f.SHIFT]
    rows[k, sensed + _Scalar.DRIVING_POSITION] = like(c[0, lf.DRIVING_POSITION], speed) + shift
    pulleys = forces.lane_pulleys(belt, share, state.scalars)
    n = fields.rows
    axial = zero
    for wrap in range(2):
        contact, places = state.contacts[1] if wrap else state.contacts[0], belt.places[wrap][0]
        weight = contact.weight
        axial = sliding = open_length = zero
        length = 0.0
        for i in range(weight.size):
            j = places[i]
            a, b, force = j - 1 if j > 0 else n - 1, j + 1 if j < n - 1 else 0, stations[j, lf.FORCE]
            slope, v_element = (fields[b, f.W] - fields[a, f.W]) * belt.per_span[j], fields[j, f.V_ELEMENT]
            v_across = fma(belt_speed + v_element, slope, fields[j, f.U])
            _, slides = forces.groove_sliding(
                belt, j, pulleys, belt_speed, v_across, v_element, fields[j, f.W]
            )
            axial += weight[i] * force
            sliding += weight[i] * force * slides
            if contact.rise[i] == 0.0:
                open_length += select(force > 0.0, zero, weight[i])
                length += weight[i]
        rows[k, sensed + _Scalar.AXIAL_FORCE_DRIVING + wrap] = axial
        rows[k, sensed + _Scalar.SLIP_DRIVING + wrap] = sliding / (maximum(axial, LEAST_FORCE) * belt_speed)
        rows[k, sensed + _Scalar.OPEN_SHARE_DRIVING + wrap] = open_length / length
        rows[k, sensed + _Scalar.TILT_DRIVING + wrap] = opening_by_tilt(state, wrap)
    audit(belt, state, stations, axial, sensing.interval, rows, k, sensed + len(SCALARS), profiles)
    rows[k, sensed + _STEP_RIPPLE] = forces.step_ripple(belt, state, stations)
    for j in range(profiles.rows):
        add(profiles, j, CONTACT_FORCE, stations[j, lf.FORCE])
        add(profiles, j, MEAN_DISPLACEMENT, fields[j, f.W])


@kernel
def _watch(belt: LaneBelt, state: LaneState, stations: LaneArray, ended: LaneArray) -> None:
    """Find the lanes whose state is out of bounds."""
    n, fields = belt.cell.size, state.fields
    content = largest = strain = gap = like(0.0, fields[0, f.W])
    length = 0.0
    for j in range(n):
        for field in range(len(f.FIELDS)):
            # 0 times what is not a number or infinite is not a number
            content = fma(fields[j, field], 0.0, content)
        largest = maximum(absolute(fields[j, f.W]), largest)
        strain = maximum(maximum(absolute(stations[j, lf.EPS_1]), -stations[j, lf.EPS_0]), strain)
        gap = maximum(belt.cell[j] * stations[j, lf.EPS_0], gap)
        length += belt.cell[j]
    speed, c = state.scalars[0, lf.SPEED], belt.constants
    total = fma(speed, 0.0, fma(state.scalars[0, lf.POSITION], 0.0, like(content, speed)))
    nominal = like(c[0, lf.DRIVING_SPEED] / c[0, lf.RATIO], speed)
    nominal = nominal * forces.lane_speed_share(belt, state.time[0], speed)
    nominal = nominal + state.scalars[0, f.FIRST_STATE + f.EXCESS] / like(c[0, lf.RATIO], speed)
    code = like(Outcome.OK.value, speed)
    strain = like(maximum(gap * (1.0 / length), strain), speed)
    code = select(strain > LARGEST_STRAIN, Outcome.OVERSTRAINED.value, code)
    unsolved = (
        state.contacts[0].scalars[0, compliance.UNSOLVED] + state.contacts[1].scalars[0, compliance.UNSOLVED]
    )
    code = select(like(unsolved, speed) > 0.0, Outcome.NO_CONTACT_SOLUTION.value, code)
    code = select(speed < LEAST_SPEED * nominal, Outcome.SLIPPED_THROUGH.value, code)
    code = select(speed > MOST_SPEED * nominal, Outcome.RAN_AWAY.value, code)
    code = select(like(largest, speed) > belt.largest_displacement, Outcome.LEFT_THE_GROOVES.value, code)
    code = select(total <= 0.0, code, Outcome.NOT_FINITE.value)
    running = ended[0, OUTCOME] < 0.5
    ended[0, ENDED_AT] = select(running, like(state.time[0], speed), ended[0, ENDED_AT])
    solves = state.contacts[0].scalars[0, compliance.SOLVES] + state.contacts[1].scalars[0, compliance.SOLVES]
    ended[0, CONTACT_SOLVES] = select(running, like(solves, speed), ended[0, CONTACT_SOLVES])
    ended[0, REPEATED] = select(running, state.scalars[0, lf.REPEATS], ended[0, REPEATED])
    ended[0, OUTCOME] = select(running, code, ended[0, OUTCOME])


class Sampled(NamedTuple):
    """The belt of which samples are taken, not in parts, and the step's work space."""

    belt: LaneBelt
    state: LaneState
    stations: LaneArray


@kernel
def march(
    begin: Any,
    advance: Any,
    take: Any,
    belt: LaneBelt,
    state: LaneState,
    work: Any,
    step: float,
    steps: int,
    sampled: Sampled,
    samples: Samples,
    first: int,
    last: int,
) -> None:
    """Fill rows first .. last - 1 with samples, `steps` steps of `step` [s] before each.

    The kernels: begin(belt, state, work) comes first; advance(belt, state, work, step) takes a step; take,
    with the arguments of `take_sample`, takes a sample. `sampled` is of the same run or runs; at the end it
    has all of the state.
    """
    begin(belt, state, work)
    for k in range(first, last):
        for taken in range(steps):
            note_speeds(belt, state, work.stations, taken, steps)
            advance(belt, state, work, step)
        take(state, work, sampled, samples, k)
    gather(state, work.stations, sampled, work.stations.data.shape[1])


@kernel
def begin_at_once(belt: LaneBelt, state: LaneState, work: Any) -> None:
    """Begin a march whose step needs no more than the results of `derive`."""


@kernel
def take_sample(state: LaneState, work: Any, sampled: Sampled, samples: Samples, k: int) -> None:
    """Sample the marched belt, which may be in parts."""
    gather(state, work.stations, sampled, lf.FIELDS_OF_FORCES)
    sample(sampled.belt, sampled.state, sampled.stations, samples, k)
    # a sample takes it to its end
    state.scalars[0, lf.LAYER_WORK] = like(
        sampled.state.scalars[0, lf.LAYER_WORK], state.scalars[0, lf.LAYER_WORK]
    )


@kernel
def gather(state: LaneState, stations: LaneArray, sampled: Sampled, fields: int) -> None:
    """Join the sampled values from linked parts, of the stations' work space its first `fields`."""
    merge_parts(state.fields, sampled.state.fields, state.fields.data.shape[1])
    merge_parts(stations, sampled.stations, fields)
    merge_parts(state.column, sampled.state.column, state.column.data.shape[1])
    merge_parts(state.tilt, sampled.state.tilt, state.tilt.data.shape[1])
    merge_parts(state.scalars, sampled.state.scalars, state.scalars.data.shape[1])


@kernel
def sample_state(belt: LaneBelt, state: LaneState, stations: LaneArray, samples: Samples, k: int) -> None:
    """Take a sample, as `sample` does, of a state whose forces are not known yet."""
    derive(belt, state, stations)
    sample(belt, state, stations, samples, k)
