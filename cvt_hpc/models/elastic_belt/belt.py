"""Constants and initial state of the elastic belt on its mesh.

The reference path is cut into cells whose faces lie on the ends of the arcs. Displacement w, transverse
velocity u, the layers' speeds v_i and the filtered sliding speed live on faces ("stations", station j at the
left face of cell j); the content n_i, the strains and the forces in cells. Rows of the state are listed in
`FIELDS`, its scalars in `SCALARS`.
"""

from __future__ import annotations

from itertools import accumulate
from typing import NamedTuple

import numpy as np

from cvt_hpc.models.elastic_belt import belt_settings
from cvt_hpc.models.elastic_belt import fields as f
from cvt_hpc.models.elastic_belt.bending import bending_bands, bending_load, squared_curvature
from cvt_hpc.models.elastic_belt.deflection_settings import disc_settings
from cvt_hpc.models.elastic_belt.grouping import faded_coupling
from cvt_hpc.models.elastic_belt.pulleys import Pulleys, settled_tilt, with_pulleys
from cvt_hpc.parameters import Parameters
from cvt_hpc.physics.friction import FrictionLaw, given_law
from cvt_hpc.physics.geometry import Variator, cut_path, variator
from cvt_hpc.physics.sheaves import Sheaves, axial_element_stiffness, flexibility, sheaves, stiffness_factors
from cvt_hpc.variator import LARGEST_DISPLACEMENT, PULLEYS
from cvt_hpc.variator.course import SPEED, THRUST, profile_table
from cvt_hpc.variator.scene import Measures, measures, rounded
from cvt_hpc.vibration.ramped import ramped

REGIONS = ("driving arc", "t1", "driven arc", "t2")
MODES = 5  # half waves along a strand that are resolved
# Share of a strand beyond a tangent point where the groove is tested for contact, which ends long before
REACH = 0.1


class Belt(NamedTuple):
    """Everything the kernels need, in SI units; N stations around the belt.

    Arrays of cells and stations have shape (N,), `per_...` being reciprocals, the span that of two cells.
    """

    cell: np.ndarray
    dual: np.ndarray
    per_cell: np.ndarray
    per_dual: np.ndarray
    per_span: np.ndarray
    curvature: np.ndarray
    arc_curvature: np.ndarray
    touches: np.ndarray  # 1 where a groove may hold a station, else 0
    on_driven: np.ndarray  # 1 from the middle of t1 to that of t2, else 0
    rise: np.ndarray  # the path's distance from the axis beyond the pitch radius (`Mesh.zone`)
    lean: np.ndarray  # where a groove may hold it, part of the pulley's radial unit vector along the path
    lean_rate: np.ndarray  # less of that per displacement [1/m]
    upright: np.ndarray  # part of that vector across the path
    driving_stations: np.ndarray  # those that the groove may hold, (m,)
    driven_stations: np.ndarray  # likewise, (m,)
    bending: np.ndarray  # force per length on station j from the displacements of j-2 .. j+2, (N, 5)
    bending_load: np.ndarray  # that without displacement
    squared_curvature: np.ndarray  # kappa^2 at the stations where curvature terms count, else 0
    curvature_terms: int  # place among those in CURVATURE_TERMS
    ring_mass: np.ndarray  # inertia along the path, as `element_mass`
    ring_relief: np.ndarray  # tension at which the rings' own weight bears them
    element_mass: float
    mass: float  # inertia across the path
    bending_stiffness: float
    # of the pitch line at `driving_speed`; along a ramp of speed both follow `rhs.speed_share_at`
    belt_speed: float
    element_stiffness: float
    ring_stiffness: float
    element_damping: float
    # times a gap's strain: most push of the elements' damper across the gap; inf, as in every run: elements
    # that are apart have no damper
    bridging_stiffness: float
    has_column: bool
    column_stiffness: float
    outer_edge: float
    inner_edge: float
    ring_damping: float
    tilts: bool  # whether elements tilt on the rings
    tilt_spring: float
    tilt_damper: float
    transverse_damping: float
    ring_offset: float
    ring_friction: float
    ring_friction_speed: float
    law: FrictionLaw
    friction_speed: float
    friction_memory: float
    half_wedge_angle: float
    driving: Sheaves
    driven: Sheaves
    driving_radius: float
    driven_radius: float
    driving_speed: float
    driving_position: float
    driven_inertia: float
    pulleys: Pulleys
    axial_damping: float
    thrust: float
    ratio: float
    load: float
    load_start: float
    speed_start: float
    profile: np.ndarray  # `course.profile_table`, (K, 4)
    rise_time: float
    start_damping: float
    largest_displacement: float  # a belt that is further off its path has left its grooves
    faded: float  # coupling that counts for nothing
    measures: Measures  # of the scene
    ramp_end: float


class State(NamedTuple):
    """The state: `fields` (7, N) in the order of FIELDS, `scalars` (12,) in the order of SCALARS.

    Of elements that tilt `fields` is (8, N), with ELEMENT_TILT; of rings in n layers (7 + 2 n, N), see
    `rings.py`. The work of the layers' dampers [J] until it is read is no state of the belt.
    """

    fields: np.ndarray
    scalars: np.ndarray

    def copy(self) -> State:
        """Return an independent copy."""
        return State(self.fields.copy(), self.scalars.copy())


class Mesh(NamedTuple):
    """Cells of the closed path: number per region, first station of each region, cell lengths (N,) [m]."""

    counts: tuple[int, ...]
    starts: tuple[int, ...]
    cell: np.ndarray
    path: Variator

    @property
    def position(self) -> np.ndarray:
        """Path coordinate s of the stations [m], (N,); s = 0 at the inlet of the driving arc."""
        return np.concatenate([[0.0], np.cumsum(self.cell)[:-1]])

    @property
    def region(self) -> np.ndarray:
        """Region of each cell, 0..3 in the order of REGIONS, (N,)."""
        return np.repeat(np.arange(4), self.counts)

    @property
    def curvature(self) -> np.ndarray:
        """Curvature of the path in the cells [1/m], (N,)."""
        return np.array([1.0 / self.path.driving_radius, 0.0, 1.0 / self.path.driven_radius, 0.0])[
            self.region
        ]

    def along(self, region: int) -> np.ndarray:
        """Way of a region's stations, its end included, from its start [m], (count + 1,)."""
        first = self.starts[region]
        return np.insert(np.cumsum(self.cell[first : first + self.counts[region]]), 0, 0.0)

    def zone(self, region: int, reach: float = REACH) -> Zone:
        """Stations that the groove of an arc may hold: the arc's, and those of `reach` of both strands.

        On a strand, x beyond the tangent point, the pulley's axis is at the distance rho = hypot(x, R + w),
        and its radial unit vector has the angle atan(x / (R + w)) to the path's normal. To the first order in
        w / R that is rho = rho_0 + w R / rho_0, and x / rho_0 (1 - w R / rho_0^2) along the path.
        """
        n, first, count = self.cell.size, self.starts[region], self.counts[region]
        radius = self.path.driving_radius if region == 0 else self.path.driven_radius
        way = self.along((region + 1) % 4)  # both strands are cut alike
        more = [int(np.count_nonzero(way[1:] <= max(reach * way[-1], way[1])))] * 2
        stations = np.arange(first - more[0], first + count + more[1] + 1) % n
        along = np.insert(np.cumsum(self.cell[stations[:-1]]), 0, 0.0)
        along -= along[more[0]]  # [m] from the inlet
        on_arc = np.clip(along, 0.0, along[more[0] + count])
        x = along - on_arc
        return Zone(stations, on_arc / radius + np.arctan2(x, radius), x, np.hypot(x, radius) - radius)


class Zone(NamedTuple):
    """Stations that one groove may hold, m of them, and their place about its axis."""

    stations: np.ndarray  # (m,) int, in the direction of travel
    angle: np.ndarray  # from the inlet's tangent point, (m,) [rad]
    beyond: np.ndarray  # way beyond the tangent points, (m,) [m]: negative before the inlet, 0 on the arc
    rise: np.ndarray  # distance from the axis beyond the pitch radius, (m,) [m]


def mesh(parameters: Parameters) -> Mesh:
    """Cut the path into `stations` cells, shorter by `end_refinement` at the ends of arcs (`cut_path`)."""
    path = variator(parameters["ratio"], parameters["driven_radius"], parameters["centre_distance"])
    cells = cut_path(path, parameters["stations"], parameters["end_refinement"])
    counts = [part.size for part in cells]
    return Mesh(tuple(counts), (0, *accumulate(counts[:-1])), np.concatenate(cells), path)


def belt_constants(parameters: Parameters) -> Belt:
    """Constants of one run for the kernels, from its resolved parameters, `duration` [s] included."""
    p, grid = belt_settings.DEFAULTS | dict(parameters), mesh(parameters)
    path, cell = grid.path, grid.cell
    dual = 0.5 * (cell + np.roll(cell, 1))
    kappa, radii = grid.curvature, (path.driving_radius, path.driven_radius)
    zones = grid.zone(0), grid.zone(2)
    middles = [grid.starts[strand] + grid.counts[strand] // 2 for strand in (1, 3)]
    stations = np.arange(cell.size)
    beyond = {name: np.zeros(cell.size) for name in ("touches", "rise", "lean", "lean_rate")}
    beyond["upright"] = np.ones(cell.size)
    for zone, radius in zip(zones, radii, strict=True):
        rho = radius + zone.rise
        beyond["touches"][zone.stations] = 1.0
        beyond["rise"][zone.stations] = zone.rise
        beyond["lean"][zone.stations] = zone.beyond / rho
        beyond["lean_rate"][zone.stations] = zone.beyond * radius / rho**3
        beyond["upright"][zone.stations] = radius / rho
    along_rings = cell * (1.0 + kappa * p["ring_offset"])
    ring_mass = p["ring_mass"] * 0.5 * (along_rings + np.roll(along_rings, 1)) / dual
    belt_speed = p["driving_speed"] * path.driving_radius
    whole, disc = stiffness_factors(p)
    size = measures(p)
    stiffness = whole, p["tilt_stiffness"] * p["tilt_factor"], p["local_stiffness"], p["local_length"]
    flanks = axial_element_stiffness(p)
    wraps = [
        sheaves(dual[zone.stations], zone.angle, zone.rise, radius, *stiffness, flanks, disc)
        for zone, radius in zip(zones, radii, strict=True)
    ]
    line_forces = rounded(size.force / size.length)
    turned = path.driving_wrap, path.driven_wrap
    wraps = [
        wrap._replace(line_forces=line_forces, **disc_settings(p, pulley, wrap, radius, angle))
        for pulley, wrap, radius, angle in zip(PULLEYS, wraps, radii, turned, strict=True)
    ]
    wraps, freedom = with_pulleys(p, wraps, radii)
    law = given_law(p)
    quantity, terms = ramped(p), belt_settings.CURVATURE_TERMS.index(p["curvature_terms"])
    computed = dict(
        cell=cell,
        dual=dual,
        per_cell=1.0 / cell,
        per_dual=1.0 / dual,
        per_span=0.5 / dual,
        curvature=kappa,
        arc_curvature=np.maximum(kappa, np.roll(kappa, 1)),
        **beyond,
        on_driven=((stations >= middles[0]) & (stations < middles[1])).astype(float),
        driving_stations=zones[0].stations,
        driven_stations=zones[1].stations,
        bending=bending_bands(cell, dual, p["bending_stiffness"], kappa, terms),
        bending_load=bending_load(cell, dual, p["bending_stiffness"], kappa, terms),
        squared_curvature=squared_curvature(cell, dual, kappa) * (terms > 0),
        curvature_terms=terms,
        has_column=belt_settings.has_column(p),
        tilts=belt_settings.elements_tilt(p),
        ring_mass=p["longitudinal_mass"] * ring_mass,
        ring_relief=ring_mass * belt_speed * belt_speed,
        element_mass=p["longitudinal_mass"] * p["element_mass"],
        mass=p["element_mass"] + p["ring_mass"],
        belt_speed=belt_speed,
        largest_displacement=LARGEST_DISPLACEMENT * p["centre_distance"],
        faded=faded_coupling(p),
        measures=size,
        bridging_stiffness=np.inf,
        law=law,
        driving=wraps[0],
        driven=wraps[1],
        pulleys=freedom,
        driving_radius=path.driving_radius,
        driven_radius=path.driven_radius,
        axial_damping=p["sheave_lag"] * p["lag_stiffness"],
        load_start=p["load_start"] if quantity == "load" else p["load"],
        speed_start=p["speed_start"] if quantity == "speed" else p["driving_speed"],
        profile=profile_table(p),
        ramp_end=p["duration"] if quantity in ("load", "speed") else p["rise_time"],
    )
    # all else is a parameter of the run, by the same name
    given = {key: p[key] for key in Belt._fields if key not in computed}
    return Belt(**computed, **given)


def initial_state(parameters: Parameters, belt: Belt) -> State:
    """Start near the steady state without load.

    The belt is seated in both grooves under the tension that the thrust requires, the layers at uniform
    strain.
    """
    p, grid = parameters, mesh(parameters)
    tangent = np.tan(p["half_wedge_angle"])
    pull = 2.0 * tangent * p["thrust"] * belt.profile[0, THRUST] / grid.path.driven_wrap
    w = np.zeros(grid.cell.size)
    bent = grid.cell * belt.curvature
    bent = 0.5 * (bent + np.roll(bent, 1))  # angle that each station stands for [rad]
    arcs = []
    states = np.zeros(f.STATES)
    for region, sheave, radius, tilted in (
        (0, belt.driving, belt.driving_radius, f.DRIVING_COS),
        (2, belt.driven, belt.driven_radius, f.DRIVEN_COS),
    ):
        on_arc = sheave.rise == 0.0
        stations = slice(grid.starts[region], grid.starts[region] + grid.counts[region] + 1)
        force = np.where(on_arc, pull / (2.0 * tangent * radius), 0.0)
        tilting = sheave.tilt @ (sheave.weight * force)
        tilt = settled_tilt(belt.pulleys, tilted, tilting)
        states[tilted : tilted + 2] = tilt
        tilt = tilt + sheave.clearance * tilting / np.linalg.norm(tilting)
        w[stations] = -(flexibility(sheave) @ force + tilt @ sheave.tilt)[on_arc] / (2.0 * tangent)
        arcs.append(stations)
    w[arcs[0]] -= p["driving_position"] / (2.0 * tangent)
    # the belt keeps its length: it moves inward at the driving and outward at the driven pulley
    lift = -(bent @ w) / grid.path.driven_wrap
    w[arcs[1]] += lift
    _fill_strands(w, grid)

    mean = [bent[stations] @ w[stations] / bent[stations].sum() for stations in arcs]
    speed = belt.speed_start * belt.profile[0, SPEED] * (belt.driving_radius + mean[0])
    fields = np.zeros((len(f.FIELDS) + belt.tilts, grid.cell.size))
    fields[f.W] = w
    fields[f.V_ELEMENT] = fields[f.V_RING] = speed
    length = 1.0 + belt.curvature * 0.5 * (w + np.roll(w, -1))
    ring_length = length + belt.curvature * p["ring_offset"]
    rings = grid.cell @ (1.0 + belt.curvature * p["ring_offset"])
    rings /= 1.0 + p["reference_tension"] / p["ring_stiffness"]
    fields[f.N_ELEMENT] = length * (grid.path.path_length - p["play"]) / (grid.cell @ length)
    fields[f.N_RING] = ring_length * rings / (grid.cell @ ring_length)
    scalars = [0.0, speed / (belt.driven_radius + mean[1]), -2.0 * tangent * lift, 0.0]
    return State(fields, np.concatenate([scalars, states]))


def _fill_strands(w: np.ndarray, grid: Mesh) -> None:
    """Straight lines between the arcs' ends."""
    for region in (1, 3):
        first, count = grid.starts[region], grid.counts[region]
        share = grid.along(region) / grid.path.lengths[region]
        w[first : first + count] = ((1.0 - share) * w[first] + share * w[(first + count) % w.size])[:-1]


def random_strands(grid: Mesh, size: float, seed: int) -> np.ndarray:
    """Random mixture of the first six sine shapes of both strands: displacement of the stations (N,) [m].

    It is `size` [m] at most, and 0 on the arcs. The mixture of a seed does not depend on the mesh.
    """
    random = np.random.default_rng(seed)
    shape = np.zeros(grid.cell.size)
    for region in (1, 3):
        x = grid.along(region)[:-1] / grid.path.lengths[region]
        stations = slice(grid.starts[region], grid.starts[region] + grid.counts[region])
        shape[stations] = sum(random.normal() * np.sin(k * np.pi * x) for k in range(1, 7))
    return size * shape / np.abs(shape).max()
