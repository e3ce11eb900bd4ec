"""One motion in all of a record: band, amplitude, frequencies, spectrum and reason of random scenes."""

import re

import numpy as np
import pytest

from cvt_hpc.job import build_job
from cvt_hpc.simulation.marching import march_runs
from cvt_hpc.variables import Status, Vibrates
from cvt_hpc.variator.band import band, strand_frequencies
from cvt_hpc.vibration.settings import ABOVE_MODES, BELOW_MODES
from cvt_hpc.vibration.signals import amplitude_spectrum, band_amplitude
from support.marched import never

SCENES, STEP = 16, 10.0


@pytest.fixture(scope="module")
def judged():
    """Runs and records of scenes that fill the lanes once: slow and loose belts, fast and pressed ones, and some that vibrate."""
    rng = np.random.default_rng(4)
    common = {"stations": 64, "duration": 0.12, "longest_duration": 0.12, "spectrum_step": STEP}
    points = []
    for k in range(SCENES):
        wide = k % 2  # every other scene is near the papers' working point
        values = {
            "driving_speed": rng.uniform(*((60.0, 500.0) if wide else (280.0, 350.0))),
            "thrust": rng.uniform(*((8e3, 70e3) if wide else (45e3, 55e3))),
            "load_share": rng.uniform(*((0.05, 0.6) if wide else (0.3, 0.5))),
            "friction_gradient": rng.uniform(-1.4, -0.8),
            "element_mass": rng.uniform(0.7, 1.4),
        }
        job = build_job({"name": "scene", "model": "elastic_belt"}, "scene", common | values)
        points.append(job.point(0))
    found = march_runs(job, points, never, range(SCENES))
    ended = [(run, r) for run, r in found if r["status"] == Status.DONE and np.isfinite(r["amplitude"]).all()]
    assert len(ended) > 0.8 * SCENES
    assert len({int(r["vibrates"]) for _, r in ended}) > 1
    return ended


def test_the_band_follows_the_forces_of_each_run(judged):
    edges = []
    for run, found in judged:
        p = run.parameters
        assert (found["lower_band_edge"], p["band_high"]) == band(run)
        first = strand_frequencies(p, tuple(found["mean_ring_tension"] - found["mean_push_force"]))[:, 0]
        resolved = 5.0 / (p["judged_fraction"] * p["duration"])
        expected = [max(edge, resolved) for edge in (BELOW_MODES * first.min(), ABOVE_MODES * first.max())]
        assert min(abs(found["lower_band_edge"] / edge - 1.0) for edge in expected) < 1e-6
        edges.append(found["lower_band_edge"])
    assert max(edges) > 1.5 * min(edges)


def test_amplitude_frequencies_and_spectrum_are_of_the_motion_in_the_band(judged):
    bins = np.arange(0.0, 1500.0 + STEP / 2, STEP)
    for run, found in judged:
        rate = run.parameters["sampling_rate"]
        moved = run.displacement[run.judged]
        of_strands = [k for k, probe in enumerate(run.probes) if probe.label.split()[0] in ("t1", "t2")]
        each = band_amplitude(moved[:, of_strands], rate, band(run))
        assert found["amplitude"].max() == each.max()
        lobe = 4.0 * rate / len(moved)  # so far what moves below the band leaks into it
        inside = bins >= found["lower_band_edge"] + lobe
        for strand in range(2):
            line, first = found["strongest_frequency"][strand], found["frequency"][strand]
            assert line / first == pytest.approx(round(line / first), abs=1e-9)
            assert found["lower_band_edge"] <= first <= line <= 1500.0
            spectrum = found["spectrum"][strand]
            top = spectrum[np.argmin(np.abs(bins - line))]
            assert top >= 0.98 * spectrum[inside].max()
        probe = of_strands[int(np.argmax(each))]
        told = amplitude_spectrum(moved[:, probe], rate, bins)
        assert told == pytest.approx(found["spectrum"][int(np.argmax(found["amplitude"]))], abs=1e-15)


def test_the_reason_names_the_amplitude(judged):
    vibrating = [found for _, found in judged if found["vibrates"] == Vibrates.YES]
    assert vibrating
    for found in vibrating:
        clauses = re.findall(r"t(\d) vibrates for the last \S+ s, (\S+) um", str(found["reason"]))
        for strand, size in clauses:
            assert float(size) == float(f"{1e6 * found['amplitude'][int(strand) - 1]:.3g}")
        assert clauses
