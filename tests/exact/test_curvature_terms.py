"""What the path's curvature adds across the belt, on full rings: their modes are known exactly."""

import numpy as np
import pytest

from cvt_hpc.models.elastic_belt import fields as f
from cvt_hpc.models.elastic_belt.belt import State
from cvt_hpc.models.elastic_belt.bending import NONE, PATH, STRAIGHT, bending_bands, bending_load
from cvt_hpc.models.elastic_belt.one_system import flat_belt
from support.equations import evaluate
from support.straight import moving_straight, straight_belt

RADIUS, MASS, EI, CELLS = 0.048, 0.3, 0.5, 48  # of a ring whose length is that of the straight belt
ROWS = f.W, f.U, f.V_RING, f.N_RING


def ring(terms, speed=0.0):
    """A ring in the place of the belt: of rings alone, next to no elements, no pulleys, no damping."""
    belt = straight_belt(CELLS, speed)
    kappa = np.full(2 * CELLS, 1.0 / RADIUS)
    assert belt.cell.sum() == pytest.approx(2.0 * np.pi * RADIUS)
    shape = belt.cell, belt.dual, EI, kappa, terms
    return belt._replace(
        curvature=kappa,
        bending=bending_bands(*shape),
        bending_load=bending_load(*shape),
        squared_curvature=kappa**2 * (terms > 0),
        curvature_terms=terms,
        ring_mass=np.full(2 * CELLS, MASS),
        element_mass=1e-9,
        mass=MASS + 1e-9,
        ring_offset=0.0,
        ring_damping=0.0,
        element_damping=0.0,
        transverse_damping=0.0,
    )


def frequencies(terms, speed=0.0, foundation=0.0):
    """Circular frequencies of a ring that turns, on springs across it [N/m^2]: eigenvalues, (frequency, shape) each."""
    belt = ring(terms, speed)
    n, start = 2 * CELLS, moving_straight(belt, tension=MASS * speed**2, push=-1e5)
    flat, eigen = flat_belt(belt), np.empty((4 * n, 4 * n))

    def rates(fields):
        evaluate(flat, State(fields, start.scalars))
        rate = flat.rate.copy()
        rate[f.W] = fields[f.U]
        rate[f.U] -= foundation / MASS * fields[f.W]
        return rate[list(ROWS)].ravel()

    for k, (row, size) in enumerate(zip(ROWS, (1e-8, 1e-4, 1e-4, 1e-7), strict=True)):
        for j in range(n):
            sides = [start.fields.copy() for _ in range(2)]
            sides[0][row, j] += size
            sides[1][row, j] -= size
            eigen[:, k * n + j] = (rates(sides[0]) - rates(sides[1])) / (2.0 * size)
    values, vectors = np.linalg.eig(eigen)
    return values, vectors[:n]


def of_shape(found, *numbers):
    """Frequencies of the shapes of n waves around, either sign [rad/s], those of the ring's stretching left out; ascending."""
    values, shapes = found
    spectrum = np.abs(np.fft.fft(shapes, axis=0))
    # exp(i (w t - n theta)): the waves whose shape is exp(-i n theta)
    waves = np.isin(np.argmax(spectrum, axis=0), [-number % (2 * CELLS) for number in numbers])
    inextensible = np.abs(values.imag) < 0.3 * np.sqrt(7.7e6 / MASS) / RADIUS
    return np.sort(values.imag[waves & inextensible])


def carrier(number, omega):
    """Both frequencies of n waves around a thin inextensible ring that turns, seen at rest [rad/s].

    nu of exp(i (nu t - n theta)) on the ring: (n^2 + 1) nu^2 + 4 n W nu + (n^2 + 1) W^2
    = (n^2 - 1)^2 W^2 + n^2 (n^2 - 1)^2 EI / (m r^4) (Carrier 1945), seen at rest nu + n W.
    """
    n = number
    stiffness = EI / (MASS * RADIUS**4) * n**2 * (n**2 - 1) ** 2
    constant = (n**2 + 1) * omega**2 - (n**2 - 1) ** 2 * omega**2 - stiffness
    return np.sort(np.roots([n**2 + 1, 4.0 * n * omega, constant])) + n * omega


def mesh_error(number):
    """Relative, of second differences over n waves: (n h / r)^2 / 12 of bending twice, of the mean w of cells, and a reserve."""
    return 0.25 * (number * np.pi / CELLS) ** 2


@pytest.mark.parametrize("foundation", [0.0, 4e6])
def test_modes_of_a_ring_at_rest_on_a_foundation(foundation):
    # w_n^2 = n^2 (n^2 - 1)^2 / (n^2 + 1) EI / (m r^4) + n^2 / (n^2 + 1) k / m: it moves along as 1/n of across
    found = frequencies(PATH, foundation=foundation)
    for n in (2, 3, 4):
        exact = n**2 * (n**2 - 1) ** 2 * EI / RADIUS**4 + n**2 * foundation
        exact = np.sqrt(exact / (MASS * (n**2 + 1)))
        # shapes of one frequency stand, or run either way
        assert np.abs(of_shape(found, n, -n)) == pytest.approx(exact, rel=mesh_error(n))


def test_modes_of_a_ring_that_turns():
    omega = 600.0
    found = frequencies(PATH, omega * RADIUS)
    for n in (2, 3, 4):
        assert of_shape(found, n) == pytest.approx(carrier(n, omega), rel=1.5 * mesh_error(n))
    # a turning ring that is moved as a whole stays there
    assert np.abs(of_shape(found, 1)).min() < 1e-3 * omega


def test_without_the_terms_a_ring_is_too_stiff():
    found = frequencies(NONE)
    # EI n^4 in the place of EI (n^2 - 1)^2
    for n in (2, 3):
        exact = carrier(n, 0.0)[1] * n**2 / (n**2 - 1)
        assert np.abs(of_shape(found, n, -n)) == pytest.approx(exact, rel=mesh_error(n))


def bent_energy(number, size):
    """EI/2 int kappa^2 ds over the reference path of r + size cos(n theta), by the exact curvature."""
    theta = 2.0 * np.pi * np.arange(512) / 512
    place = RADIUS + size * np.cos(number * theta)
    first, second = -number * size * np.sin(number * theta), -(number**2) * size * np.cos(number * theta)
    kappa = (place**2 + 2.0 * first**2 - place * second) / (place**2 + first**2) ** 1.5
    return 0.5 * EI * np.mean(kappa**2) * 2.0 * np.pi * RADIUS


@pytest.mark.parametrize("number", [0, 1, 2, 3])
def test_a_straight_belt_bends_by_the_exact_curvature(number):
    # Bullinger et al. 2005, eqs 20 and 21: force and stiffness are slope and curvature of the exact energy
    belt, size = ring(STRAIGHT), 1e-4
    n = belt.cell.size
    shape = np.cos(number * 2.0 * np.pi * np.arange(n) / n)
    force = np.array([belt.bending[j] @ shape[(j + np.arange(-2, 3)) % n] for j in range(n)])
    energies = [bent_energy(number, a) for a in (-size, 0.0, size)]
    slope, second = (
        (energies[2] - energies[0]) / (2.0 * size),
        (energies[2] - 2.0 * energies[1] + energies[0]) / size**2,
    )
    # differences of the energy: (size / r)^2. Of n^4 - 5 n^2 + 3 (n = 2: -1) the mesh knows each part to its error
    scale = EI / RADIUS**4 * np.pi * RADIUS
    assert -(belt.bending_load * belt.dual) @ shape == pytest.approx(slope, rel=1e-4, abs=1e-9 * scale)
    assert -(force * belt.dual) @ shape == pytest.approx(
        second, rel=1e-4, abs=mesh_error(number) * (number**4 + 5 * number**2) * scale
    )


def test_energy_of_the_bands_is_symmetric():
    belt = straight_belt(CELLS)
    random = np.random.default_rng(2)
    cell = belt.cell * random.uniform(0.8, 1.2, belt.cell.size)
    dual, kappa = 0.5 * (cell + np.roll(cell, 1)), np.where(np.arange(cell.size) % 40 < 20, 20.0, 0.0)
    for terms in (NONE, PATH, STRAIGHT):
        bands, n = bending_bands(cell, dual, EI, kappa, terms), cell.size
        whole = np.zeros((n, n))
        for j in range(n):
            whole[j, (j + np.arange(-2, 3)) % n] = bands[j] * dual[j]
        assert whole == pytest.approx(whole.T, abs=1e-12 * np.abs(whole).max())
