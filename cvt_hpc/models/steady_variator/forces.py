"""Results of a steady state: forces and speeds around the belt, and values for strands and pulleys.

Powers and the contact's means are those that a transient of the belt records in this state.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from cvt_hpc.models.elastic_belt import along_belt as along
from cvt_hpc.models.elastic_belt import fields as f
from cvt_hpc.models.elastic_belt.belt import REGIONS, Mesh
from cvt_hpc.models.elastic_belt.column import pressed_strains
from cvt_hpc.models.elastic_belt.rhs import contact_forces, fresh_contacts, strains
from cvt_hpc.models.elastic_belt.transient import sampled
from cvt_hpc.models.steady_variator.walking import Steady
from cvt_hpc.variator.history import along_path
from cvt_hpc.variator.slip import against_slip, largest_torque
from cvt_hpc.variator.variables import Means

if TYPE_CHECKING:
    import xarray as xr

LOSSES = ("driving_flank_loss", "driven_flank_loss", "ring_loss", "belt_loss", "seating_loss", "tilt_loss")


class Distributions(NamedTuple):
    """Distributions around the belt, (N,) each: T and P in the cells, all else at the stations."""

    ring_tension: np.ndarray  # [N]
    push_force: np.ndarray  # without its damper [N]
    contact_force: np.ndarray  # axial line force of one flank [N/m]
    element_speed: np.ndarray  # along the path [m/s]
    ring_speed: np.ndarray  # along the path [m/s]
    displacement: np.ndarray  # off the reference path, outward [m]


def driving_speed(steady: Steady) -> float:
    """Speed of the driving pulley [rad/s], which follows where a drive with inertia turns it."""
    return float(steady.belt.driving_speed + steady.state.scalars[f.FIRST_STATE + f.EXCESS])


def distributions(steady: Steady) -> Distributions:
    """Forces and speeds around the belt."""
    belt, fields = steady.belt, steady.state.fields
    n = belt.cell.size
    force, eps = np.empty(n), np.empty((2, n))
    contact_forces(belt, steady.state, fresh_contacts(belt), force)
    strains(belt, fields, eps)
    return Distributions(
        belt.ring_stiffness * eps[1],
        np.maximum(-belt.element_stiffness * pressed_strains(belt, fields, eps[0]), 0.0),
        np.maximum(force, 0.0),
        fields[f.V_ELEMENT].copy(),
        fields[f.V_RING].copy(),
        fields[f.W].copy(),
    )


def profiles(steady: Steady, grid: Mesh) -> xr.Dataset:
    """Speeds and forces by `position`, named as in a history of the elastic belt."""
    found = sampled(steady.belt, steady.state).profiles()
    sample = {name: values[:, 0] for name, values in found.items()}
    sliding = along.along_belt(sample, grid, {"half_wedge_angle": steady.belt.half_wedge_angle})
    values, words = along.elsewhere(sample, grid) | sliding, along.ELSEWHERE | along.SLIDING
    named = {name: (values[name], *words[name]) for name in words}
    named["wrap_angle"] = along.wrap_angles(grid), *along.WRAP_ANGLE
    return along_path(named, grid.position, np.array(REGIONS)[grid.region])


def layer_loss(steady: Steady) -> float:
    """Power of the layers' dampers [W]; the elements' act up to where their push has ended."""
    belt, fields = steady.belt, steady.state.fields
    eps = np.empty((2, belt.cell.size))
    strains(belt, fields, eps)
    opening, stretching = (np.roll(v, -1) - v for v in fields[f.V_ELEMENT : f.V_RING + 1])
    elastic = -belt.element_stiffness * pressed_strains(belt, fields, eps[0])
    pushed = np.maximum(elastic - belt.element_damping * opening / belt.cell, 0.0)
    rings = belt.ring_damping * stretching**2 / belt.cell
    return float((rings - (pushed - np.maximum(elastic, 0.0)) * opening).sum())


class SteadyMeans(Means):
    """A steady state on its mesh, with values by their names in `record.VARIABLES`."""

    def __init__(self, steady: Steady, grid: Mesh) -> None:
        belt, scalars, around = steady.belt, steady.state.scalars, distributions(steady)
        middles = [grid.starts[region] + grid.counts[region] // 2 for region in (1, 3)]
        self.mean_ring_tension = around.ring_tension[middles]
        self.mean_push_force = around.push_force[middles]
        self.mean = sampled(belt, steady.state).channels().__getitem__
        law, wedge, speed = belt.law, belt.half_wedge_angle, belt.belt_speed
        carried = largest_torque(law, wedge, grid.path, speed, self.each("axial_force {}"))
        self.against_slip = against_slip(steady.load, carried)
        self.driven_position = scalars[f.DRIVEN_POSITION]
        self.speed_loss = 1.0 - belt.ratio * scalars[f.DRIVEN_SPEED] / driving_speed(steady)
        layers = layer_loss(steady)
        names = "driving_power", "load_power", "ring_loss", "belt_loss", "seating_loss"
        loss = layers + sum(self.mean(name) for name in LOSSES)
        self.powers = {name: self.mean(name) for name in names} | {"layer_loss": layers, "loss": loss}
