"""Runs marched, timed and observed."""

import math

import numpy as np
import pytest

from cvt_hpc.errors import InputError
from cvt_hpc.experiments.chart import load
from cvt_hpc.experiments.chart.measuring import check_prospects, measure
from cvt_hpc.experiments.chart.quantities import History, Quantity, observe
from cvt_hpc.models import MODELS
from cvt_hpc.models.contract import Model
from support.bells import CHANNELS, Transient


def measured(chart, name, repeats=2, time_limit=math.inf):
    point = next(point for point in chart.points if point.name == name)
    return measure(point, chart.scene(point.scene), repeats, time_limit)


def cost(setting, rate=20e3):
    """What a simulated second of the bell takes: 1.1 ns over the setting for each sample."""
    return rate * 1.1e-9 / setting


def test_a_point_has_its_values_its_cost_and_its_work(write_chart):
    found = measured(load(write_chart()), "ringing-soft-3")
    assert found.reason == ""
    assert found.cost == pytest.approx(cost(1e-5), rel=1e-9)
    assert found.values["trajectory"].shape == (1, 200, 2)  # starts, 10 ms at 20 kHz, rim and foot
    assert found.values["amplitude"][0] == pytest.approx([20.02e-6, 4.004e-6], rel=1e-3)
    assert found.values["frequency"][0] == pytest.approx([500.0, 500.0], abs=0.01)
    assert found.counters == {"steps": 6000.0, "rates": 14000.0}
    assert found.simulated == pytest.approx(0.1)


def test_compiling_costs_nothing_and_the_quickest_repeat_counts(write_chart, bell, monkeypatch):
    chart = load(write_chart())
    slowness = iter([1000.0, 5.0, 3.0, 4.0])  # warming up, the first pass, two repeats
    factors = {}
    advance = Transient.advance

    def uneven(run, samples):
        before = bell.now
        failure = advance(run, samples)
        factor = factors.setdefault(id(run), None) or next(slowness)
        factors[id(run)] = factor
        bell.now = before + factor * (bell.now - before)
        return failure

    monkeypatch.setattr(Transient, "advance", uneven)
    kept = []
    init = Transient.__init__
    monkeypatch.setattr(Transient, "__init__", lambda run, *given: (kept.append(run), init(run, *given))[1])
    assert measured(chart, "ringing-soft-3").cost == pytest.approx(3 * cost(1e-5), rel=1e-9)


def test_long_runs_are_timed_once(write_chart):
    chart = load(write_chart())
    Transient.made = 0
    measured(chart, "ringing-soft-3", repeats=5)  # 0.22 s
    assert Transient.made == 2 + 5  # warmed up, observed, repeated
    Transient.made = 0
    measured(chart, "ringing-soft-2", repeats=5)  # 2.2 s
    assert Transient.made == 2
    Transient.made = 0
    base = measured(chart, "ringing-base", repeats=5)  # not repeated, since only its result counts
    assert Transient.made == 2 and base.cost == pytest.approx(cost(1e-5), rel=1e-9)


def test_costs_are_those_of_one_run_whatever_the_number_of_starts(write_chart):
    chart = load(write_chart(('title = "Ringing"', "starts = 4")))
    found = measured(chart, "ringing-soft-3")
    assert found.cost == pytest.approx(cost(1e-5), rel=1e-9)
    assert found.values["amplitude"].shape == (4, 2)
    assert found.simulated == pytest.approx(0.4)


def test_a_failed_run_is_named_with_its_instant(write_chart):
    found = measured(load(write_chart()), "ringing-soft-1")
    assert found.reason == "failed_numerics at 50 ms: the bell has cracked (by 3 mm)"
    assert found.values == {} and found.cost == pytest.approx(cost(2e-3), rel=1e-9)  # until then
    several = measured(load(write_chart(('title = "Ringing"', "starts = 4"))), "ringing-soft-1")
    assert several.reason.startswith("failed_numerics (start 1 of 4) at 50 ms")


def test_a_run_that_takes_too_long_is_given_up(write_chart):
    found = measured(load(write_chart()), "ringing-soft-2", time_limit=0.5)
    assert found.reason.startswith("timed_out at ")
    assert found.reason.endswith("ms: takes longer than the chart's time_limit")
    assert found.core_seconds < 0.5 + 0.4  # the last slice may take twice as long as the one before it
    assert found.cost == pytest.approx(cost(1e-6), rel=1e-9)  # so far


LED = (
    ('reference = "exact"', 'reference = { stepper = "hard", step = "2 us" }\n'
     'lead = { stepper = "hard", until = "40 ms", set = { step = "1 us" } }'),
    ('trajectory = { until = "10 ms", tolerance = "5 %" }\namplitude = { tolerance = "1 %" }\n'
     'frequency = { tolerance = "1 %" }\noccurrence = {}',
     'trajectory = { since = "40 ms", until = "60 ms", tolerance = "5 %" }'),
)  # fmt: skip


def test_methods_take_over_and_what_came_before_is_no_cost_of_theirs(write_chart):
    chart = load(write_chart(*LED))
    check_prospects(chart)
    found = measured(chart, "ringing-soft-3")
    assert found.simulated == pytest.approx(0.02) and found.cost == pytest.approx(cost(1e-5), rel=1e-9)
    assert set(found.values) == {"trajectory"}
    # the bell that leads is 1e-3 too loud, the reference 2e-3 and soft ones 1e-3: each from 40 ms on
    times = np.arange(801, 1201) / 20e3
    rim = 1.001 * 20e-6 * np.sin(2 * np.pi * 500 * times)
    assert found.values["trajectory"][0, :, 0] == pytest.approx(rim, abs=1e-12)
    reference = measured(chart, "ringing-reference")
    assert reference.values["trajectory"][0, :, 0] == pytest.approx(1.002 / 1.001 * rim, abs=1e-12)
    assert reference.simulated == pytest.approx(0.02)


def test_a_lead_that_fails_is_named_as_such(write_chart):
    chart = load(write_chart((LED[0][0], LED[0][1].replace('"40 ms", set = { step = "1 us"', '"60 ms", set = { step = "2 ms"')),
                                   (LED[1][0], LED[1][1].replace("40 ms", "60 ms").replace('"60 ms", tol', '"70 ms", tol'))))  # fmt: skip
    found = measured(chart, "ringing-soft-3")
    assert found.reason == (
        "failed_numerics at 50 ms: the bell has cracked (by 3 mm), before the method takes over"
    )


def test_a_model_whose_runs_cannot_take_over_is_refused(write_chart, monkeypatch):
    import bell.transient as module

    monkeypatch.delattr(module, "TAKES_OVER")
    with pytest.raises(InputError, match="lead: expected a model whose runs can take over from others"):
        check_prospects(load(write_chart(*LED)))


class Batch:
    """Bells that ring together: two cost as much as one."""

    def __init__(self, points, stepper, paused=()):
        self.runs = tuple(Transient(point, stepper) for point in points)
        self.samples, self.interval = self.runs[0].samples, self.runs[0].interval

    @property
    def done(self):
        return self.runs[0].done

    @property
    def running(self):
        return self.done < self.samples

    def advance(self, samples):
        before = Transient.clock.now
        for run in self.runs:
            Transient.clock.now = before
            run.advance(samples)


def test_lanes_are_filled_and_share_their_time(write_chart, monkeypatch):
    import bell.transient as module

    monkeypatch.setattr(module, "batch", Batch)
    monkeypatch.setattr(Model, "lanes", lambda model, parameters, stepper: 2)
    chart = load(
        write_chart(('stepper = "soft"', 'stepper = "soft"\nlanes = 2'), ('title = "Ringing"', "starts = 3"))
    )
    check_prospects(chart)
    found = measured(chart, "ringing-soft-3")
    assert found.cost == pytest.approx(cost(1e-5) / 2, rel=1e-9)
    assert found.values["amplitude"].shape == (3, 2)  # the fourth run fills a lane, and is not judged
    alone = load(write_chart(('title = "Ringing"', "starts = 3")))
    assert np.array_equal(found.values["amplitude"], measured(alone, "ringing-soft-3").values["amplitude"])
    assert measured(alone, "ringing-soft-3").cost == pytest.approx(cost(1e-5), rel=1e-9)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('stepper = "soft"', 'stepper = "soft"\nlanes = 2',
         "c.toml: [chart.methods.soft] lanes: expected at most 1 with stepper soft, found 2"),
        ("occurrence = {}", "push_force = {}",
         "c.toml: [chart.scenes.ringing] quantities: expected those that an exact solution has, "
         "found channel push_force t1"),
        ("occurrence = {}\n", 'occurrence = {}\n[chart.scenes.s]\nmodel = "oscillator"\nreference = "exact"\n'
         'set = { friction_law = "stribeck", friction_gradient = -2 }\nquantities = { amplitude = {} }\n', None),
    ],
)  # fmt: skip
def test_models_are_asked_before_anything_is_computed(write_chart, old, new, message):
    job = write_chart((old, new), ("[chart.methods.clever]", '[chart.methods.clever]\nscenes = ["ringing"]'))
    if message is None:
        job = write_chart((old, new), *((f'[chart.methods.{name}]', f'[chart.methods.{name}]\nscenes = ["ringing"]')
                                        for name in ("soft", "clever", "hard")))  # fmt: skip
        message = "c.toml: [chart.scenes.s] reference: exact motion: expected friction_law coulomb"
    with pytest.raises(InputError) as caught:
        check_prospects(load(job))
    assert str(caught.value).startswith(message)


def test_a_channel_that_is_not_recorded_is_refused(write_chart, monkeypatch):
    job = write_chart(('reference = "exact"', 'reference = { stepper = "hard", step = "2 us" }'),
                      ("occurrence = {}", "push_force = {}"))  # fmt: skip
    with pytest.raises(
        InputError, match="quantities: expected a model that records push_force t1, found bell"
    ):
        check_prospects(load(job))
    check_prospects(load(write_chart(
        ('reference = "exact"', 'reference = { stepper = "hard", step = "2 us" }'),
        ("occurrence = {}", "onset = {}"))))  # fmt: skip
    # a method may be of another model
    monkeypatch.setattr(Model, "channels", property(lambda model: CHANNELS if model.name == "bell" else ()))
    monkeypatch.setitem(MODELS, "gong", "bell")
    job = write_chart(('reference = "exact"', 'reference = { stepper = "hard", step = "2 us" }'),
                      ("occurrence = {}", "onset = {}"),
                      ("[chart.methods.hard]", '[chart.methods.hard]\nmodel = "gong"'))  # fmt: skip
    with pytest.raises(InputError, match="quantities: expected a model that records load, found gong"):
        check_prospects(load(job))


PARAMETERS = {
    "sampling_rate": 20e3,
    "band_low": 300.0,
    "band_high": 1500.0,
    "amplitude_threshold": 5e-6,
    "window_length": 0.01,
    "judged_fraction": 0.5,
    "negligible_amplitude": 1e-8,
    "decay_tolerance": 0.25,
    "growth_tolerance": 1.0,
}


def growing(rate=20.0, duration=0.3, start=1e-7):
    times = (1 + np.arange(round(duration * 20e3))) / 20e3
    wave = start * np.exp(rate * times) * np.sin(2 * np.pi * 500 * times)
    return History(np.column_stack([wave, 0.1 * wave]), ("t1", "t2"), lambda name: 300.0 * times, PARAMETERS)


def test_onset_is_the_load_at_which_the_amplitude_meets_the_threshold():
    history = growing()
    (load,) = observe(history, [Quantity("onset", math.inf, 0.0, channel="load")], True)["onset"]
    crossing = np.log(5e-6 / 1e-7) / 20.0
    assert load == pytest.approx(300.0 * crossing, rel=2e-3)
    # a window's amplitude leads its middle by the curvature of an exponential: rate^2 x length^2 / 60
    later = Quantity("onset", math.inf, 0.0, since=0.25, channel="load")
    assert np.isnan(
        observe(history, [later], True)["onset"][0]
    )  # above from the first window on: no onset seen


def test_growth_is_that_of_the_part_asked_for():
    quantity = Quantity("growth_rate", math.inf, 0.0, since=0.05, until=0.2)
    found = observe(growing(-35.0, start=1e-3), [quantity], True)
    assert found["growth_rate"] == pytest.approx([-35.0, -35.0], rel=1e-3)
    assert found["amplitude"].shape == (2,)  # tells which strand counts


def test_forces_and_losses_are_means_of_the_judged_part():
    levels = {"ring_tension t1": 2.0, "ring_tension t2": 3.0, "ring_loss": 5.0}
    levels |= {"driving_flank_loss": 7.0, "driven_flank_loss": 11.0}
    # before the judged half a channel is far away, and rises over it from 0 to twice its level
    shape = np.concatenate([np.full(2000, 100.0), np.linspace(0.0, 2.0, 2000)])
    still = History(np.zeros((4000, 2)), ("t1", "t2"), lambda name: levels[name] * shape, PARAMETERS)
    asked = [Quantity(name, math.inf, 0.0) for name in ("ring_tension", "friction_loss")]
    found = observe(still, asked, True)
    assert found["ring_tension"] == pytest.approx([2.0, 3.0])
    assert found["friction_loss"] == pytest.approx([7.0, 11.0, 5.0])


def test_speed_loss_is_that_of_the_mean_speeds():
    levels = {"driving_speed": 60.0, "driven_speed": 23.76, "tension t1": 100.0, "tension t2": 300.0}
    parameters = {**PARAMETERS, "ratio": 2.5}
    steady = History(np.zeros((4000, 2)), ("t1", "t2"), lambda name: np.full(4000, levels[name]), parameters)
    asked = [Quantity(name, math.inf, 0.0) for name in ("speed_loss", "strand_tension")]
    found = observe(steady, asked, True)
    assert found["speed_loss"] == pytest.approx([0.01])
    assert found["strand_tension"] == pytest.approx([100.0, 300.0])
