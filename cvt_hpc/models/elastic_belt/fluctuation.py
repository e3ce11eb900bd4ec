"""Energy that enters and leaves a vibration: the audit of the fluctuations about the mean motion.

A force f that works at the speed v has the mean power <f v> = <f> <v> + <f' v'>: the power of the mean force
in the mean motion, and the power fed into the fluctuation. Friction of the flanks takes power on the whole,
and yet feeds where it falls as sliding gets faster (Lebrecht et al. 2004, eqs 15-19). While the mean state
stays, each equation of motion (`rhs.py`) times the fluctuation of its own speed, u = w_t, v_0 or v_1, has the
mean 0. Summed over the belt,

    flanks + stresses = belt + rings + layers + lag + carried + remainder,

    flanks     sum of <p' v_r'> + <f_t' v_t'>, fed where positive; p, f_t their radial and tangential
               friction, v_r, v_t the sliding in the groove
    stresses   sum of <P' v_0,s'> - <T' v_1,s'> - <F' kappa u'> - <(F w_s)' u_s'>
    belt       sum of d_b <v_a'^2>, v_a = w_t + v_0 w_s the speed across the belt
    rings      sum of <q' v_q'>, v_q the speed of the saddles against the rings
    layers     work of the layers' dampers, less that of their mean forces in the mean motion
    lag        T_1 k <z_dn'^2>, which is what the contact's elastic forces take from the belt
    carried    flanks less belt, less the sum of <h' u'> + <g' v_0'>, with h and g the forces of friction and
               damping across and along the belt: on an arc h = p - d_b v_a and g = f_t + (h + e) w_s, e the
               contact's elastic radial force

Stresses within a belt whose elements touch throughout hand power on, and sum up to 0. Where gaps open and
close they feed: the mean push works in the mean opening, and elements that the mean motion has drawn apart
close with an impact. The carried power goes to the mean motion: its speed V works against the force along the
path <h' w_s'> that the vibration exerts, the pulleys against the changing moment of <f_t' w'>. Flanks less
carried is the effect of friction on u and v_0 at a fixed place, as `linear_stability` counts it; an error in
the flanks' part alone would not open the sum.

The remainder is the effect of the numerics (upwinding, backward Euler, work of dampers that samples do not
meet), the energy gained while the vibration grows, and bending. Fluctuations of all frequencies count, judder
and hum of gaps too, and a trend of the mean state would: along a ramp of load or speed nothing is known.
"""

from typing import NamedTuple

import numpy as np

from cvt_hpc.models.elastic_belt.belt import Mesh
from cvt_hpc.parameters import Parameters
from cvt_hpc.variables import Variable
from cvt_hpc.vibration.ramped import ramped

ARC_PARTS = 4  # of each wrap, of equal length, from its inlet to its outlet

VARIABLES = (
    Variable(
        "part_flank_loss", "W", "mean friction power of the flanks by arc part", dims=("pulley", "arc_part")
    ),
    Variable(
        "flank_fed",
        "W",
        "power that friction of the flanks feeds into the fluctuation by arc part; negative: takes",
        dims=("pulley", "arc_part"),
        words="feed by flank friction",
    ),
    Variable(
        "stress_fed",
        "W",
        "power that push and tension feed into the fluctuation, where gaps open and close",
        words="feed by push and tension",
    ),
    *(
        Variable(f"{name}_taken", "W", f"power that {what} from the fluctuation", words=words)
        for name, what, words in (
            ("belt", "the belt's transverse damping takes", "taken by belt damping"),
            ("ring", "friction between rings and elements takes", "taken by ring friction"),
            ("layer", "the layers' longitudinal dampers take", "taken by layer dampers"),
            ("lag", "the driven sheave's lag takes", "taken by sheave lag"),
        )
    ),
    Variable(
        "carried_power",
        "W",
        "power that goes from the fluctuation to the mean motion",
        words="power to the mean motion",
    ),
    Variable(
        "fluctuation_remainder",
        "W",
        "power that is fed into the fluctuation less the power taken and carried",
    ),
)


class Fluctuation(NamedTuple):
    """Mean power that each part of the belt feeds into the fluctuation [W], (N,); negative: takes.

    Of the stations, and `stresses` of the cells; `mean_layers`, a number, is the power that the layers'
    dampers take from the mean motion, which is no fluctuation.
    """

    flanks: np.ndarray
    belt: np.ndarray
    rings: np.ndarray
    carried: np.ndarray
    stresses: np.ndarray
    mean_layers: float


def fluctuation(means: dict[str, np.ndarray], grid: Mesh, parameters: Parameters) -> Fluctuation:
    """Power of the fluctuations around the belt.

    `means` are MOMENTS over the number of samples, and `mean_displacement` [m], (N,) each.
    """
    m, p = means, parameters
    dual = at_stations(grid.cell)
    flanks = m["flank_power"] - m["radial_friction"] * m["radial_speed"]
    flanks = flanks - m["tangential_friction"] * m["sliding_speed"]
    belt = -p["transverse_damping"] * (m["across_speed_squared"] - m["across_speed"] ** 2)
    own = m["transverse_power"] - m["transverse_force"] * m["transverse_speed"]
    own = own + m["element_power"] - m["element_force"] * m["element_speed"]
    opening, stretching = _step(m["element_speed"]), _step(m["ring_speed"])
    mean_stresses = m["push_force"] * opening - m["ring_tension"] * stretching - _lifting(m, grid, p)
    lifted = _lifted(m, grid)
    mean_rings = p["ring_damping"] * ((stretching + lifted) ** 2 / grid.cell).sum()
    powers = (
        dual * flanks,
        dual * belt,
        m["saddle_friction"] * m["saddle_speed"] - m["saddle_power"],
        dual * (own - flanks - belt),
        m["stress_power"] - mean_stresses,
        mean_rings - m["push_damping"] @ (opening + lifted),
    )
    return Fluctuation(*(steadiness(p) * power for power in powers))


def steadiness(parameters: Parameters) -> float:
    """1, or not a number along a ramp: its trend would count as a fluctuation."""
    return np.nan if ramped(parameters) else 1.0


def _lifted(m: dict[str, np.ndarray], grid: Mesh) -> np.ndarray:
    """Speed at which the cells of the arcs lengthen by their mean transverse motion [m/s], (N,)."""
    u = m["transverse_speed"]
    return grid.cell * grid.curvature * (u + 0.5 * _step(u))


def _lifting(m: dict[str, np.ndarray], grid: Mesh, p: Parameters) -> np.ndarray:
    """Power of the cells' mean stresses in the mean transverse motion [W], (N,)."""
    speed = p["driving_speed"] * grid.path.driving_radius
    net = m["ring_tension"] - m["push_force"] - (p["element_mass"] + p["ring_mass"]) * speed**2
    turning = _step(m["mean_displacement"]) * _step(m["transverse_speed"]) / grid.cell
    return net * (_lifted(m, grid) + turning)


def at_stations(values: np.ndarray) -> np.ndarray:
    """Mean of a quantity of the cells, (..., N), in the two beside each station."""
    return 0.5 * (values + np.roll(values, 1, axis=-1))


def _step(values: np.ndarray) -> np.ndarray:
    """Difference of a stations' quantity over each cell."""
    return np.roll(values, -1) - values


def part_shares(grid: Mesh) -> np.ndarray:
    """Share of each station's contact that lies in each part of the arcs, (2, ARC_PARTS, N).

    They add up to 1 where a groove may hold a station: its contact reaches over half of both cells beside it,
    and beyond an arc's end it counts to the part there.
    """
    shares = np.zeros((2, ARC_PARTS, grid.cell.size))
    borders = np.linspace(0.0, 1.0, ARC_PARTS + 1)
    for pulley, region in enumerate((0, 2)):
        first, count = grid.starts[region], grid.counts[region]
        along = grid.along(region) / grid.path.lengths[region]
        edges = np.concatenate([[0.0], 0.5 * (along[1:] + along[:-1]), [1.0]])
        inside = np.diff(np.clip(edges, borders[:-1, None], borders[1:, None]), axis=1)
        beyond = grid.zone(region).beyond
        shares[pulley, 0, grid.zone(region).stations[beyond < 0.0]] = 1.0
        shares[pulley, -1, grid.zone(region).stations[beyond > 0.0]] = 1.0
        shares[pulley, :, first : first + count + 1] = inside / np.diff(edges)
    return shares
