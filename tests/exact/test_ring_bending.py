"""Bending of the pushbelts' rings in the plane: its energy, waves on a strand, and a strand that is held askew."""

import numpy as np
import pytest

from cvt_hpc.models.pushbelt.belt import in_lanes, of_lanes
from cvt_hpc.models.pushbelt.ring_bending import COLUMNS, bend_rings
from cvt_hpc.physics.out_of_plane import clamped_force
from support.pushbelts import given, start

STIFFNESS, AT_ONCE = 0.5, 1e-9  # [N m^2], [s]: a step that smooths nothing


def bent(belt, state, places, dt):
    """Forces on the elements (n, 2) [N], and the energy [J], by saddle points (n, 2) [m]."""
    count = len(places)
    forces, energy = in_lanes(np.zeros((count, 2))), in_lanes(np.zeros((count, 1)))
    bend_rings(
        belt,
        state.pulleys,
        in_lanes(places).data,
        forces.data,
        energy.data[:, 0],
        np.zeros((count, COLUMNS)),
        dt,
    )
    return of_lanes(forces), of_lanes(energy).sum()


def at_rest(nodes, **changes):
    """A belt, its state, and its saddle points."""
    belt, state = start(given(nodes=nodes, bending_stiffness=STIFFNESS, **changes))
    return belt, state, of_lanes(state.elements)[:, :2].copy()


@pytest.mark.parametrize("dt", [AT_ONCE, 1e-5, 1e-4])
def test_forces_are_the_gradient_of_the_energy(dt):
    belt, state, places = at_rest(64)
    places += np.random.default_rng(1).normal(0.0, 3e-5, places.shape)
    found, small = bent(belt, state, places, dt)[0], 1e-8
    expected = np.zeros_like(found)
    for place in np.ndindex(*places.shape):
        for sign in (-1.0, 1.0):
            moved = places.copy()
            moved[place] += sign * small
            expected[place] -= sign * bent(belt, state, moved, dt)[1] / (2.0 * small)
    assert np.abs(found).max() > 1.0
    assert found == pytest.approx(expected, abs=1e-7 * np.abs(found).max())


@pytest.mark.parametrize(("dt", "length"), [(AT_ONCE, 0.15), (1e-5, 0.15), (1e-5, 7e-3)])
def test_a_wave_on_a_strand_is_held_by_ei_k4(dt, length):
    """Between supports, -EI k^4 w; of a wave of w from bending the smoothing leaves out (w dt)^2."""
    belt, state, places = at_rest(432, ratio=1.0, centre_distance=0.31, belt_length=0.9)
    strand = (places[:, 1] < 0.0) & (np.abs(places[:, 0] - 0.155) < 0.15)
    wave = 2.0 * np.pi / length
    w = 1e-6 * np.sin(wave * places[:, 0])
    places[strand, 1] -= w[strand]
    found = -bent(belt, state, places, dt)[0][:, 1]
    inside = strand & (np.abs(places[:, 0] - 0.155) < 0.08)  # away from the ends of the wave
    waves = 2.0 * np.sin(0.5 * wave * belt.pitch) / belt.pitch
    square = STIFFNESS * belt.pitch * waves**4 / (belt.mass + belt.ring_mass)
    expected = -(belt.mass + belt.ring_mass) * square / (1.0 + square * dt**2) * w
    assert (square * dt**2 > 0.1) == (length < 0.01)
    assert found[inside] == pytest.approx(expected[inside], abs=1e-3 * np.abs(expected).max())


def test_a_strand_that_is_held_askew_is_stiffened_as_a_clamped_beam():
    """Its end is moved across by e: V = F e / l / (1 - tanh(u) / u), u = l sqrt(F / EI) / 2."""
    belt, state, places = at_rest(432, ratio=1.0)
    tension, aside = 400.0, 1e-6
    strand = np.flatnonzero((places[:, 1] < 0.0) & (np.abs(places[:, 0] - 0.0775) < 0.05))
    base = bent(belt, state, places, AT_ONCE)[0][strand, 1]
    slopes = np.zeros((strand.size, strand.size))
    for k, place in enumerate(strand):
        moved = places.copy()
        moved[place, 1] += aside
        slopes[:, k] = (base - bent(belt, state, moved, AT_ONCE)[0][strand, 1]) / aside
    count = strand.size
    slopes += tension / belt.pitch * (2.0 * np.eye(count) - np.eye(count, k=1) - np.eye(count, k=-1))
    ends = np.where(np.arange(count) < 3, 0.0, 1.0)
    free = slice(3, count - 3)
    held = np.r_[0:3, count - 3 : count]
    shape = ends.copy()
    shape[free] = np.linalg.solve(slopes[free, free], -slopes[free, held] @ ends[held])
    across = -(slopes @ shape)[:3].sum()
    length = (count - 4) * belt.pitch  # from halfway between the last two that are held
    string = tension / length
    expected = clamped_force(1.0, length, tension, STIFFNESS)
    assert across == pytest.approx(expected, rel=2e-3) and expected > 2.5 * string


def test_a_belt_on_its_path_bears_no_moment():
    belt, state, places = at_rest(432)
    assert np.abs(bent(belt, state, places, 1e-5)[0]).max() < 1.0
