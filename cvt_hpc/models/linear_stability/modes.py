"""Small motions about a steady state: their growth, their shape, and the source of their energy.

A mode's growth rate is shared out over the belt by the power of friction. With masses m_k of the velocities
v_k (u, v_0 and v_1 of each station, complex amplitudes) and the amplitudes a_k of the accelerations that the
flanks and the rings' saddles cause,

    fed = Re(conj(v_k) m_k a_k) / (2 sum m_k |v_k|^2)

is their power over twice the vibration's energy, which is twice its mean kinetic one; of a mass on a spring
with the damping d it is -d / (2 m).

All eigenvalues in a band of frequencies are found that are not strongly damped, by shift and invert: about a
point of the complex plane Arnoldi's method finds the nearest eigenvalues, and no other lies in the disc up to
the farthest of them. Discs are laid up along the middle of the rectangle that was requested, each as far on
as the last one reaches, until they cover it: so nothing in it can be missed.
"""

from typing import NamedTuple

import numpy as np
from scipy.sparse import csc_array, eye_array
from scipy.sparse.linalg import LinearOperator, eigs, splu

from cvt_hpc.models.elastic_belt import fields as f
from cvt_hpc.models.elastic_belt.belt import MODES, Mesh
from cvt_hpc.models.elastic_belt.one_system import flat_belt, pack, rates
from cvt_hpc.models.elastic_belt.rhs import strains
from cvt_hpc.models.steady_variator.equations import LATE
from cvt_hpc.models.steady_variator.linearised import Linearisation, corners
from cvt_hpc.models.steady_variator.walking import Steady

NEAREST = 12  # eigenvalues of each disc to begin with: fewer need more discs, more take longer
# [rad/s]: half of the part of the band that the first disc covers, guessed
_FIRST_REACH = 2.0 * np.pi * 400.0
_OVERLAP = 0.95  # of a disc's half height
ALIKE = 1e-5  # relative: eigenvalues of two discs that are one


def eigenpairs(
    matrix: csc_array, low: float, high: float, decay: float, growth: float
) -> tuple[np.ndarray, np.ndarray]:
    """Eigenvalues in a rectangle, -`decay` to `growth` by `low` to `high`, and their vectors.

    The real (n, n) matrix has those of rates [1/s] and circular frequencies [rad/s]. Values, (m,), are in the
    order of their real parts, the largest first; vectors, (n, m), are columns of length 1.
    """
    whole, identity = matrix.astype(complex), eye_array(matrix.shape[0], format="csc")
    start = np.random.default_rng(0).normal(size=matrix.shape[0]) + 0j
    values, vectors = np.empty(0, complex), np.empty((matrix.shape[0], 0), complex)
    middle, width = 0.5 * (growth - decay), 0.5 * (growth + decay)
    covered, reach, nearest = low, _FIRST_REACH, NEAREST
    while covered < high:
        centre = middle + 1j * (covered + _OVERLAP * reach)
        inverse = splu((whole - centre * identity).tocsc())
        operator = LinearOperator(matrix.shape, matvec=inverse.solve, dtype=complex)
        found, shapes = eigs(operator, k=nearest, which="LM", v0=start)
        found = centre + 1.0 / found
        radius = np.abs(found - centre).max()
        reach = np.sqrt(max(radius**2 - width**2, 0.0))
        if reach < 0.1 * width:
            # they lie so densely that the disc hardly reaches beyond the rectangle
            nearest, reach = 2 * nearest, width
            continue
        if centre.imag - reach > covered:
            continue  # the disc is smaller than was guessed: lay it nearer
        covered = centre.imag + reach
        values, vectors = np.append(values, found), np.hstack([vectors, shapes])
    wanted = (values.imag > low) & (values.imag < high)
    wanted &= (values.real > -decay) & (values.real < growth)
    values, vectors = values[wanted], vectors[:, wanted]
    fresh = [k for k in range(values.size) if not np.any(np.abs(values[:k] / values[k] - 1.0) < ALIKE)]
    order = np.array(fresh, dtype=int)[np.argsort(-values[fresh].real, kind="stable")]
    return values[order], vectors[:, order]


LOW, HIGH = 100.0, 1500.0  # [Hz]: the band of strands
DECAY, GROWTH = 400.0, 5000.0  # [1/s]: modes that decay or grow faster are left out
LOOSE = 0.1  # [N], scaled as the scene's forces: a push that any vibration overcomes
APART = 1e-8  # strain of elements that are taken as apart


class Mode(NamedTuple):
    """One mode."""

    growth: float  # growth rate; negative: it decays [1/s]
    frequency: float  # [Hz]
    # largest displacement of the regions in the order of REGIONS, over the largest of all, (4,)
    amplitudes: np.ndarray
    strand: int  # that which moves most: 0 is t1, 1 is t2
    half_waves: int  # of the strongest sine along that strand, measured from the chord between its ends
    # share of the growth rate that friction of flanks and saddles at each station feeds, (N,) [1/s]
    fed: np.ndarray
    displacement: np.ndarray  # amplitude of w, the largest 1, (N,) complex
    vector: np.ndarray  # of all unknowns of `flat`, in the same measure, (n,) complex


def modes(
    steady: Steady, grid: Mesh, band: tuple[float, float] = (LOW, HIGH), decay: float = DECAY
) -> list[Mode]:
    """Modes of a steady state in a band [Hz], the one that grows fastest first.

    Dampers of the elements are as in the state. Modes that decay faster than `decay` [1/s] are left out.
    """
    belt = steady.belt._replace(bridging_stiffness=steady.belt.element_stiffness)
    flat = flat_belt(belt, LATE)
    y = pack(flat, steady.state)
    if not rates(flat, 0.0, y, np.empty_like(y)):
        raise ValueError("the contact of this state has no solution")
    linearise, pressed = Linearisation(flat), corners(belt, flat.state) > 0.0
    whole = linearise(flat, pressed)
    # the same without flanks and saddles: the difference is the effect of their friction and contact
    nowhere = np.zeros_like(belt.touches)
    without = belt._replace(touches=nowhere, arc_curvature=nowhere)
    free = linearise(flat._replace(belt=without), pressed)
    values, vectors = eigenpairs(whole, 2.0 * np.pi * band[0], 2.0 * np.pi * band[1], decay, GROWTH)
    n = belt.cell.size
    velocities = slice(n, 4 * n)
    friction = (whole - free).tocsr()[velocities]
    masses = np.concatenate(
        [belt.mass * belt.dual, belt.element_mass * belt.dual, belt.ring_mass * belt.dual]
    )
    found = []
    for value, vector in zip(values, vectors.T, strict=True):
        vector = vector / vector[np.abs(vector[:n]).argmax()]
        speeds = vector[velocities]
        power = (speeds.conj() * masses * (friction @ vector)).real / (2.0 * masses @ np.abs(speeds) ** 2)
        shape = _shape(vector[:n], grid)
        frequency = float(value.imag / (2.0 * np.pi))
        found.append(
            Mode(float(value.real), frequency, *shape, power.reshape(3, n).sum(axis=0), vector[:n], vector)
        )
    return found


def loosened(steady: Steady) -> Steady | None:
    """The state with those elements apart that touch with a push below LOOSE; None where there are none.

    Transverse damping alone holds the elements of an unloaded strand together, by some 0.01 N. A growth rate
    belongs to closed elements or to open ones there, and a vibration goes through both.
    """
    belt, state = steady.belt, steady.state.copy()
    eps = np.empty((2, belt.cell.size))
    strains(belt, state.fields, eps)
    push = -belt.element_stiffness * eps[0]
    loose = (push >= 0.0) & (push < LOOSE * belt.measures.force)
    if not loose.any():
        return None
    state.fields[f.N_ELEMENT, loose] *= (1.0 + eps[0, loose]) / (1.0 + APART)
    return steady._replace(state=state)


def _shape(w: np.ndarray, grid: Mesh) -> tuple[np.ndarray, int, int]:
    """Amplitudes of the regions, the strand that moves most and its half waves."""
    largest, waves = np.empty(4), np.zeros(4, dtype=int)
    for region in range(4):
        first, count = grid.starts[region], grid.counts[region]
        part = np.append(w[first : first + count], w[(first + count) % w.size])
        largest[region] = np.abs(part).max()
        along = grid.along(region) / grid.path.lengths[region]
        weights = np.append(0.0, 0.5 * (np.diff(along)[1:] + np.diff(along)[:-1]))
        sines = np.sin(np.pi * np.outer(np.arange(1, MODES + 1), along)) * np.append(weights, 0.0)
        chord = part[0] + along * (part[-1] - part[0])
        waves[region] = 1 + np.abs(sines @ (part - chord)).argmax()
    strand = int(largest[3] > largest[1])
    return largest / largest.max(), strand, int(waves[2 * strand + 1])
