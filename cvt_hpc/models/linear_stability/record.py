"""The record of linear stability: the verdict, and the mode that grows fastest."""

from typing import Any, NamedTuple

import numpy as np

from cvt_hpc.models.steady_variator import record as steady_record
from cvt_hpc.parameters import Parameters
from cvt_hpc.variables import Coordinate, Status, Values, Variable, Vibrates

VARIABLES = (
    Variable("growth_rate", "s-1", "of the mode that grows fastest; none found: nan"),
    Variable(
        "loosened_growth_rate",
        "s-1",
        "growth rate with those elements apart that are hardly pressed together, by 0.1 N at most; nan: none",
        may_miss=True,
    ),
    Variable("frequency", "Hz", "of the mode that grows fastest"),
    Variable("lower_band_edge", "Hz", "lowest frequency of the modes by which the state is judged"),
    Variable(
        "vibrating_strand",
        "1",
        "strand in which the mode that grows fastest is largest: 1 is t1, 2 is t2; 0: no mode",
        dtype="i1",
    ),
    Variable(
        "mode", "1", "of that mode along its vibrating strand; 0: no mode", dtype="i1", words="half waves"
    ),
    Variable("relative_amplitude", "1", "largest displacement of that mode by region", dims=("region",)),
    Variable(
        "fed",
        "s-1",
        "part of the growth rate of that mode that friction in each region adds",
        dims=("region",),
        words="feed by friction",
    ),
    *steady_record.VARIABLES,
)


class Solution(NamedTuple):
    """Result of linear stability."""

    steady: Values | ValueError  # numbers of the steady state, or why there is none
    modes: list  # in the band, the one that grows fastest first
    # growth rate of the first mode of the state as `loosened` has it [1/s]; nan where that is the same
    loosened: float
    lower_edge: float  # where the band begins [Hz]
    starts: np.ndarray  # first station of each region, (4,)
    undecided: float  # growth up to which nothing is decided [1/s]


def coordinates(parameters: Parameters) -> dict[str, Coordinate]:
    """Coordinates of the record's dimensions, whatever the parameters."""
    from cvt_hpc.models.elastic_belt.belt import REGIONS

    regions = {"region": Coordinate(np.array(REGIONS), "", "region", "of the path")}
    return steady_record.coordinates(parameters) | regions


def cost(parameters: Parameters, stepper: None) -> Any:
    """Core-seconds of a run: of a first steady state, and a tenth for each of two spectra."""
    return 1.2 * steady_record.cost(parameters, stepper)


def solve(parameters: Parameters) -> Solution:
    """Steady state and its modes for the parameters of a run [SI]."""
    from cvt_hpc.models.elastic_belt.belt import mesh
    from cvt_hpc.models.linear_stability.modes import DECAY, loosened, modes
    from cvt_hpc.models.steady_variator.forces import driving_speed
    from cvt_hpc.models.steady_variator.record import quantities
    from cvt_hpc.models.steady_variator.walking import NoSteadyState, SteadyBelt
    from cvt_hpc.variator.band import steady_band

    p, grid = parameters, mesh(parameters)
    try:
        steady = SteadyBelt(p).at(p["load"])
    except NoSteadyState as error:
        return Solution(error, [], np.nan, np.nan, np.array(grid.starts), p["undecided_growth"])
    means = quantities(steady, grid)
    tension, push = means["mean_ring_tension"], means["mean_push_force"]
    forces = tension[0] - push[0], tension[1] - push[1]
    band = steady_band({**p, "driving_speed": driving_speed(steady)}, forces)
    growth, loose = np.nan, loosened(steady)
    if loose is not None:
        found = modes(loose, grid, band)
        growth = found[0].growth if found else -DECAY
    first = modes(steady, grid, band)
    return Solution(means, first, growth, band[0], np.array(grid.starts), p["undecided_growth"])


def judge(solution: Solution) -> Values:
    """The record of a run, its cost apart."""
    if isinstance(solution.steady, ValueError):
        return {"status": Status.FAILED_NUMERICS, "reason": str(solution.steady)}
    found = {"status": Status.DONE, "lower_band_edge": solution.lower_edge, **solution.steady}
    found["loosened_growth_rate"] = solution.loosened
    margin, loosened = solution.undecided, f"{solution.loosened:.3g}/s with elements apart that hardly touch"
    if not solution.modes:
        holds = not solution.loosened >= -margin
        reason = "every mode in the band decays fast" + ("" if holds else f", but {loosened}")
        return found | {"vibrates": Vibrates.NO if holds else Vibrates.UNDECIDED, "reason": reason}
    first = solution.modes[0]
    words = f"growth {first.growth:.3g}/s at {first.frequency:.4g} Hz"
    rates = [first.growth]
    if not np.isnan(solution.loosened):
        rates.append(solution.loosened)
        words += f", {loosened}"
    vibrates = Vibrates.UNDECIDED
    if min(rates) > margin or max(rates) < -margin:
        vibrates = Vibrates.YES if first.growth > 0.0 else Vibrates.NO
    return found | {
        "vibrates": vibrates,
        "reason": f"{words}, undecided up to {margin:g}/s",
        "growth_rate": first.growth,
        "frequency": first.frequency,
        "vibrating_strand": first.strand + 1,
        "mode": first.half_waves,
        "relative_amplitude": first.amplitudes,
        "fed": np.add.reduceat(first.fed, solution.starts),
    }
