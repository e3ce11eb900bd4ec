"""A model that is new to the package, in the lines of `van_der_pol` alone: swept, recorded, mapped, simulated."""

import numpy as np
import pytest

from cvt_hpc import open_results, run, simulate
from cvt_hpc.analysis.figures import draw
from cvt_hpc.analysis.maps import map_figure
from cvt_hpc.job import build_job
from cvt_hpc.models import MODELS
from cvt_hpc.variables import Vibrates

DOCUMENT = {
    "name": "limit_cycles",
    "model": "van_der_pol",
    "axes": {"excitation": [-0.1, 0.1, 0.2], "size": [1e-5, 2e-5]},
    "scene": {"start": "2 um"},
    "numerics": {"step": "20 us"},
}


@pytest.fixture
def job(monkeypatch):
    monkeypatch.setitem(MODELS, "van_der_pol", "van_der_pol")
    return build_job(DOCUMENT, "new.toml")


def test_a_new_model_is_swept_mapped_and_simulated(job, tmp_path):
    report = run(job, tmp_path / "out", progress=False)
    assert report.done == report.total == 6
    results = open_results(tmp_path / "out")
    assert (results.vibrates.sel(excitation=-0.1) == Vibrates.NO).all()
    cycles = results.sel(excitation=[0.1, 0.2], strand="mass")
    assert (cycles.vibrates == Vibrates.YES).all()
    # averaging: the amplitude is right to the first order in e, the frequency to the third; the peak over the
    # band has no harmonics. 1 %: e^2 / 8, and 1e-3: a bin of the spectrum is interpolated
    assert np.allclose(cycles.amplitude / cycles["size"], 2.0, rtol=1e-2)
    expected = 600.0 * (1.0 - cycles.excitation**2 / 16.0)
    assert np.allclose(cycles.frequency / expected, 1.0, rtol=1e-3)
    assert draw(lambda: map_figure(results), tmp_path / "map.png").stat().st_size > 0
    history = simulate(job, {"excitation": 0.2, "size": 2e-5})
    assert history.vibrates == Vibrates.YES and history.frequency == cycles.frequency[1, 1]
