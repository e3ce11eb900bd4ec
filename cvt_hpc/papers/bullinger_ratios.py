"""Statements of Bullinger, Funk and Pfeiffer 2005 about figs 5, 22 and 23: off speed ratio 1."""

import numpy as np

from cvt_hpc.papers.verdicts import Kept, Measured, Statement, listed, over_arc

APPROXIMATE = 2.0  # [%]: what is stated as equal
APART = 1.0  # [N]: push force below which elements count as apart
RUNNING, RESTING = 3000 * np.pi / 30, 0.1 * np.pi / 30  # [rad/s]


def _push(kept: Kept, ratio: float, share: float) -> np.ndarray:
    return kept.run(ratio=ratio, load_share=share)["mean_push_force"].values


def _push_without_torque(kept: Kept) -> Measured:
    over, under = _push(kept, 0.5, 0.0), _push(kept, 2.0, 0.0)
    holds = over[0] > APART > over[1], under[1] > APART > under[0]
    said = f"P in t1 and t2 without torque: overdrive {listed(over)} N, underdrive {listed(under)} N"
    return Measured(holds, said)


def _rise_disappears(kept: Kept) -> Measured:
    def rise(ratio: float, share: float) -> float:
        push = over_arc(kept.history(ratio=ratio, load_share=share), "push_force", "driven").values
        return 100 * (push.max() / push[0] - 1)

    low, high = ([rise(ratio, share) for ratio in (0.5, 2.0)] for share in (0.3, 0.85))
    said = f"rise behind the entry, i 0.5 and 2: {listed(low)} % (r 0.3), {listed(high, '.2g')} % (r 0.85)"
    return Measured([a > 1 and b < 0.2 * a for a, b in zip(low, high, strict=True)], said)


def _angle_below_at_high_ratio(kept: Kept) -> Measured:
    histories = (kept.history(ratio=ratio, load_share=0.85) for ratio in (0.5, 2.0))
    first = [np.degrees(over_arc(each, "sliding_angle", "driven").values[1]) for each in histories]
    return Measured([angle < 90 for angle in first], f"at r 0.85 {listed(first)} deg at the driven entry")


FIGURE_22 = (
    Statement("Without torque P occurs in t1 in overdrive and in t2 in underdrive", _push_without_torque),
    Statement("For both speed ratios the increase of P after the driven entry disappears for high r",
              _rise_disappears),
    Statement("since the sliding angle is then below pi/2", _angle_below_at_high_ratio,
              "in underdrive sliding still turns behind the entry at r 0.85, and there P still rises a "
              "little: angle and rise go together"),
)  # fmt: skip


# torque ratio, and speed of the driving pulley [rad/s]
REVERSED, AT_REST, ALONE, LOADED = (-0.33, RUNNING), (0.0, RESTING), (0.0, RUNNING), (0.63, RUNNING)


def _normal(kept: Kept, case: tuple[float, float]) -> np.ndarray:
    share, speed = case
    return over_arc(kept.history(load_share=share, driving_speed=speed), "normal_force", "driving").values


def _thirds(force: np.ndarray) -> tuple[float, float]:
    """Means over the first and the last third of the wrap."""
    n = force.size // 3
    return float(force[:n].mean()), float(force[-n:].mean())


def _symmetric_at_rest(kept: Kept) -> Measured:
    force = _normal(kept, AT_REST)
    off = 100 * np.abs(force - force[::-1]).max() / force.mean()
    return Measured([off < 1], f"inlet and outlet side differ by {off:.2g} % at most")


def _peaks_by_neighbours(kept: Kept) -> Measured:
    force = _normal(kept, AT_REST)
    peaks = [100 * (force[k] / np.median(force) - 1) for k in (0, -1)]
    return Measured([peak > 5 for peak in peaks], f"inlet and outlet {listed(peaks)} % above the middle")


def _rotation_moves_peaks(kept: Kept) -> Measured:
    rest, turning = _normal(kept, AT_REST), _normal(kept, ALONE)
    change = [100 * (turning[k] / rest[k] - 1) for k in (0, -1)]
    holds = [change[0] < 0, change[1] > 0]
    return Measured(holds, f"rotation changes inlet and outlet by {listed(change)} %")


def _load_moves_force(kept: Kept) -> Measured:
    alone, loaded = _normal(kept, ALONE), _normal(kept, LOADED)
    change = [100 * (loaded[k] / alone[k] - 1) for k in (0, -1)]
    holds = [change[0] > 0, change[1] < 0]
    return Measured(holds, f"r = 0.63 changes inlet and outlet by {listed(change)} %")


def _reverse_moves_force(kept: Kept) -> Measured:
    shares = [np.divide(*_thirds(_normal(kept, share))) for share in (REVERSED, ALONE, LOADED)]
    return Measured([shares[0] < shares[1], shares[1] < shares[2]],
                    f"inlet third over outlet third: {listed(shares)} at r -0.63, 0, 0.63")  # fmt: skip


def _reverse_is_like_none(kept: Kept) -> Measured:
    shapes = [force / force.mean() for force in (_normal(kept, share) for share in (REVERSED, ALONE, LOADED))]
    off = [100 * np.sqrt(np.mean((shapes[k] - shapes[1]) ** 2)) for k in (0, 2)]
    holds = [off[0] < 0.5 * off[1]]
    return Measured(holds, f"shapes at r -0.63 and 0.63 are {listed(off)} % (rms) off that at r 0")


FIGURE_23 = (
    Statement("No torque and no rotation: the distribution is symmetric", _symmetric_at_rest),
    Statement("with peaks at the inlet and the outlet due to neighbour support", _peaks_by_neighbours),
    Statement("Rotation decreases the peak at the inlet and increases that at the outlet",
              _rotation_moves_peaks),
    Statement("For r > 0 the normal force increases at the inlet and decreases at the outlet",
              _load_moves_force),
    Statement("For r < 0 it is contrary", _reverse_moves_force),
    Statement("The plots for r < 0 and r = 0 are similar, that for r > 0 is different",
              _reverse_is_like_none),
)  # fmt: skip


def _inversion(kept: Kept, ratio: float) -> float:
    """Torque ratio at which P_t1 = P_t2; nan where it does not change sign."""
    shares = kept.results["load_share"].values
    difference = np.array([np.subtract(*_push(kept, ratio, share)) for share in shares])
    k = int(np.argmax(difference > 0))
    if k == 0:
        return np.nan
    a, b = difference[k - 1 : k + 1]
    return float(shares[k - 1] - a * (shares[k] - shares[k - 1]) / (b - a))


def _inverts_at_torque(kept: Kept) -> Measured:
    over, under = _inversion(kept, 0.5), _inversion(kept, 2.0)
    holds = [over < -0.02, under > 0.02]
    return Measured(holds, f"P_t1 = P_t2 at r {over:.2g} in overdrive, {under:.2g} in underdrive")


def _tensions_ordered(kept: Kept) -> Measured:
    tension = kept.results["mean_ring_tension"]
    ratio = tension.sel(strand="t2") / tension.sel(strand="t1")
    under, over = ratio.sel(ratio=2.0).values, ratio.sel(ratio=0.5).values
    return Measured([(under > 1).all(), (over < 1).all()],
                    f"T_t2 / T_t1: underdrive {listed(under)}, overdrive {listed(over)}")  # fmt: skip


def _transmits(kept: Kept) -> Measured:
    found = kept.results
    net = found["mean_ring_tension"] - found["mean_push_force"]
    force = net.sel(strand="t2") - net.sel(strand="t1")
    radius = found["driven_radius"] / found["ratio"]
    off = 100 * np.abs(force - found["load"] / radius).max() / np.abs(force).max()
    said = f"(T - P)_t2 - (T - P)_t1 and M / r differ by {float(off):.2g} % of the largest force"
    return Measured([off < APPROXIMATE], said)


FIGURE_5 = (
    Statement("In underdrive T_t2 is always above T_t1, in overdrive the opposite", _tensions_ordered),
    Statement("Without torque a push in t2 equalises that in underdrive, one in t1 in overdrive",
              _push_without_torque),
    Statement("The inversion of the compression is not at zero torque but at M0, depending on the ratio",
              _inverts_at_torque),
    Statement("M / r = (T - P)_t2 - (T - P)_t1 (eq. 1)", _transmits,
              "eq. 1 leaves out the torque that covers the losses, and rings that pull beyond the pitch "
              "line"),
)  # fmt: skip
