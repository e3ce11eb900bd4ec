"""From when on a run counts as vibrating: the parameters of [vibration].

The defaults, and why:

- `band_low` 0: the band begins where `lower_edge` puts it for each run, as recorded in `lower_band_edge`. A
  number in a job is a constant. `band_high` 1500 Hz: twice the noise of 500-700 Hz (Lebrecht et al. 2004,
  sec. 3.1), so that third modes and second harmonics are in; models of this belt are not meant to be dynamic
  much above 1 kHz.
- `amplitude_threshold` 5 um: half of the simulated 10 um and a quarter of the measured 20 um (Lebrecht et al.
  2004, figs. 3.3 and 3.9); judder alone moves strands by up to 4 um in the band.
- `judged_fraction` 1/2: the first half belongs to the start transient; belt damping alone (d_b/(2 m) = 190
  1/s in the reference belt) takes nine decades off it within 0.12 s.
- `window_length` 40 ms: six periods of 150 Hz, where bands begin as a rule, keep drift and judder out, and
  beats between neighbouring modes (50 Hz apart and more) average out. Shortened where the judged part would
  hold fewer than four windows; for the shortest part that is accepted, to two periods.
- `decay_tolerance` 0.25 e-folds over the judged part: settled amplitudes scatter by 2-7 % from one 50 ms
  window to the next; three times that may pass for scatter. A smaller loss still counts as decay where
  the fit leaves no doubt, that is where it exceeds `occurrence.STEADY_LOSS` and the fit's scatter.
- `growth_tolerance` 1 e-fold, gained in a steady rise from the quietest window or, beyond doubt, within one
  more record of the same length: noise in the band scatters by 10-15 % per window, and a factor of e is far
  outside.
- `negligible_amplitude` 10 nm: strands are given 1 um when the start-up is over, and motion that grows by
  itself grows from there; a strand that ends a hundred times below has decayed, whatever rounding does to its
  trend.
"""

from cvt_hpc.parameters import Parameter, Parameters, Problem, not_negative, positive
from cvt_hpc.vibration.ramped import along_ramp

PARAMETERS: dict[str, dict[str, Parameter]] = {
    "vibration": {
        "band_low": not_negative(
            0.0,
            "Hz",
            "lowest frequency of a vibration; 0: by the strands' first modes, or 300 Hz where none is known",
            sensible=(1.0, 20000.0),
        ),
        "band_high": positive(1500.0, "Hz", "highest frequency of a vibration", sensible=(1.0, 20000.0)),
        "amplitude_threshold": positive(
            5e-6, "m", "peak amplitude from which a strand vibrates", sensible=(1e-09, 0.1)
        ),
        "negligible_amplitude": not_negative(
            1e-8,
            "m",
            "peak amplitude below which a strand is quiet whatever its trend",
            sensible=(1e-12, 0.01),
        ),
        "judged_fraction": Parameter(
            0.5,
            "",
            "last part of the run that is judged, the rest being start transient",
            minimum=0.05,
            maximum=1.0,
        ),
        "window_length": positive(
            0.04, "s", "length of the windows in which the amplitude is taken", sensible=(0.0001, 10.0)
        ),
        "decay_tolerance": not_negative(
            0.25, "", "largest loss of amplitude over the judged part, in e-folds, of a settled vibration"
        ),
        "growth_tolerance": positive(
            1.0, "", "gain of amplitude, in e-folds, from which a strand is growing"
        ),
    }
}


LOWEST = 300.0  # [Hz]: where a band begins that neither the job nor the strands of a run determine
LEAST_PERIODS = 5.0  # of the band's lowest frequency in the judged part
LEAST_IN_WINDOW = 2.0  # in a window
BELOW_MODES, ABOVE_MODES = 0.7, 1.05  # of the lower, and of the higher first mode of both strands
SHORTEST_SEGMENT = 32  # samples of a window: its taper and the polynomial of drift must be resolved


def fitting_window(duration: float, wanted: float) -> float:
    """The wanted window length [s], shortened so that a record [s] holds four half-overlapping windows."""
    # Four such windows span 2.5 lengths; a little less than 1/2.5 leaves room for rounding to samples.
    return min(wanted, 0.39 * duration)


def band(parameters: Parameters) -> tuple[float, float]:
    """Lowest and highest frequency of vibrations [Hz], as far as parameters alone determine them."""
    return parameters["band_low"] or LOWEST, parameters["band_high"]


def lower_edge(parameters: Parameters, lowest_mode: float, highest_mode: float, judders: bool) -> float:
    """Lowest frequency by which a run is judged [Hz].

    It is `band_low` where that is given. Else it is BELOW_MODES of the lower first mode of both strands: they
    vibrate from 0.8 of that mode of theirs upwards, since the ends of the arcs give. Of a run that judders,
    as its driven pulley moves in jerks, it is ABOVE_MODES of the higher one instead: jerks ring the first
    modes by up to 29 um, and move strands by up to 4 um above. It is at most half of `band_high`, and at
    least what the judged part and its windows resolve. The modes are the first ones of the strands under the
    run's own forces [Hz]; nan: not known, LOWEST holds.
    """
    p = parameters
    if p["band_low"] or not lowest_mode > 0.0:
        return band(p)[0]
    resolved = max(
        LEAST_PERIODS / (p["judged_fraction"] * p["duration"]), LEAST_IN_WINDOW / p["window_length"]
    )
    found = (
        min(ABOVE_MODES * highest_mode, p["band_high"] / 2.0) if judders else edge_of_modes(p, lowest_mode)
    )
    return max(found, resolved)


def edge_of_modes(parameters: Parameters, lowest_mode: float) -> float:
    """Lowest frequency by which what does not judder is judged [Hz], as `lower_edge` has it."""
    low, high = band(parameters)
    return (
        low if parameters["band_low"] or not lowest_mode > 0.0 else min(BELOW_MODES * lowest_mode, high / 2.0)
    )


def check(parameters: Parameters) -> list[Problem]:
    """Problems between parameters: (key, expected, found), in the form of a model's check.

    They include [vibration], the `duration` of a run [s] and its `sampling_rate` [Hz].
    """
    (low, high), window = band(parameters), parameters["window_length"]
    problems = []
    if high <= low:
        problems.append(("band_high", f"a frequency above band_low = {low:g} Hz", f"{high:g} Hz"))
    if window < (least := LEAST_IN_WINDOW / low):
        problems.append(
            ("window_length", f"two periods of {low:g} Hz ({least:g} s) or more", f"{window:g} s")
        )
    judged = parameters["judged_fraction"] * parameters["duration"]
    if judged < (least := LEAST_PERIODS / low) * (1 - 1e-9):
        expected = f"a judged part of five periods of {low:g} Hz ({least:g} s) or more"
        problems.append(("duration", expected, f"judged_fraction times duration = {judged:g} s"))
    length, rate = fitting_window(judged, window), parameters["sampling_rate"]
    if round(length * rate) < SHORTEST_SEGMENT:
        expected = f"{SHORTEST_SEGMENT} samples or more in a window of {length:g} s"
        problems.append(("sampling_rate", expected, f"{rate:g} Hz"))
    return problems


def inert(parameters: Parameters) -> dict[str, str]:
    """Parameters without effect on a run, each with the setting that makes it so."""
    return {"decay_tolerance": setting} if (setting := along_ramp(parameters)) else {}
