"""Studies of very many runs: what cannot be is refused at once, and what can begins in time."""

import time
from types import SimpleNamespace

import numpy as np
import pytest

from cvt_hpc.errors import InputError
from cvt_hpc.job import build_job, definition
from cvt_hpc.models.elastic_belt.grouping import lane_key
from cvt_hpc.simulation import lane_groups, run_costs
from cvt_hpc.study import check_start, description, open_results, run
from cvt_hpc.study.batches import share_out
from cvt_hpc.study.forecast import resources
from cvt_hpc.study.forecast.resources import needs, refuse_too_large
from cvt_hpc.study.ranks.stopping import find_time_limit, planning_within
from support.study_double import Axis, Job, Simulator

MANY = (Axis("load", tuple(range(1000))), Axis("speed", tuple(range(1000))), Axis("x", tuple(range(1000))))


def test_more_runs_than_memory_are_refused_before_anything_is_made(tmp_path):
    out = tmp_path / "out"
    message = r"^double.toml: 1000000000 runs: expected 400 GB of memory for their plan, found [\d.]+ GB in this machine$"
    with pytest.raises(InputError, match=message):
        run(Job(MANY), out, simulator=Simulator(), progress=False)
    assert not out.exists()


def test_more_records_than_the_disk_holds_are_refused(tmp_path, monkeypatch):
    job, simulator = Job(), Simulator()
    disk = needs(job, simulator).disk
    room = SimpleNamespace(free=disk.results + 100)
    monkeypatch.setattr(resources.shutil, "disk_usage", lambda path: room)
    with pytest.raises(
        InputError,
        match="12 runs: expected .* kB on the disk for their records and results.nc, found .* kB at ",
    ):
        refuse_too_large(job, simulator, tmp_path)
    refuse_too_large(Job(design={"first_spacing": {}}), simulator, tmp_path)  # runs part of them
    (tmp_path / "records").mkdir()
    (tmp_path / "records" / "rank-0.log").write_bytes(bytes(disk.records))
    assert refuse_too_large(job, simulator, tmp_path) == needs(job, simulator)  # they are there


def test_the_disk_that_is_told_is_that_of_the_records(tmp_path):
    run(Job(), tmp_path, simulator=Simulator(lanes=4), progress=False)
    (log,) = (tmp_path / "records").iterdir()
    told = needs(Job(), Simulator()).disk
    # beside the records a log has its header, some 2 kB, and a mark for each batch
    assert told.records < log.stat().st_size < told.records + 3000
    # most of it is names and where chunks lie, of which 5 kB of each quantity are the most
    assert 0.8 * told.results < (tmp_path / "results.nc").stat().st_size < told.results


def test_a_plan_that_takes_longer_than_its_limit_is_given_up(tmp_path, monkeypatch):
    monkeypatch.setattr("cvt_hpc.study.ranks.stopping._SHORTEST_PLANNING", 0.2)

    class Slow(Simulator):
        def run_costs(self, job):
            try:
                time.sleep(30)
            except Exception:  # as code that goes on after an error of one run
                time.sleep(30)

    began = time.monotonic()
    with pytest.raises(
        InputError, match="^time limit: expected more than 0[.]4[0-9]+ s, which the plan of 12 runs takes"
    ):
        run(Job(), tmp_path, simulator=Slow(), progress=False, time_limit=0.5)
    assert time.monotonic() - began < 20
    assert run(Job(), tmp_path, simulator=Simulator(), progress=False).done == 12  # the folder is free again


def test_the_alarm_of_another_goes_off_after_it():
    import signal

    heard = []
    handler = signal.signal(signal.SIGALRM, lambda *_: heard.append(time.monotonic()))
    before = signal.setitimer(signal.ITIMER_REAL, 0.3)
    try:
        with planning_within(100.0, 12):
            pass
        signal.pause()
    finally:
        signal.setitimer(signal.ITIMER_REAL, *before)
        signal.signal(signal.SIGALRM, handler)
    assert len(heard) == 1


def test_a_time_limit_keeps_time_for_gathering():
    # 10^6 runs take 51 s to gather, by the README of this room
    assert 1000.0 - find_time_limit(1000.0, 1_000_000, {}).seconds > 100.0


def test_parameters_that_follow_at_very_many_places_are_no_coordinates(tmp_path, monkeypatch):
    def many():
        raise AssertionError("evaluated")

    class Costly(SimpleNamespace):
        values = property(lambda self: many())

    monkeypatch.setattr(description, "MOST_DERIVED", 11)
    few = SimpleNamespace(name="f", axes=(), values=(1.0,), unit="N", description="few", words="x")
    costly = Costly(name="m", axes=("load",), unit="N", description="many", words="x")
    run(Job(derived=(few, costly)), tmp_path, simulator=Simulator(), progress=False)
    with open_results(tmp_path) as results:
        assert "f" in results.coords and "m" not in results.coords


def test_samples_beyond_counting_are_read_in_seconds():
    document = {
        "name": "x",
        "model": "criterion",
        "design": {"kind": "sobol", "runs": 2**20},
        "axes": {"contact_force": {"from": 100, "to": 1000}},
    }
    began = time.process_time()
    job = build_job(document, "x.toml")
    # 2 s on an idle core; each sample checked takes 50 s and more
    assert time.process_time() - began < 15.0
    assert len(np.unique(job.axes[0].values)) == 2**20


def test_of_very_many_samples_the_extreme_ones_are_checked(monkeypatch):
    from cvt_hpc.job import crosscheck

    monkeypatch.setattr(crosscheck, "MOST_CHECKED_POINTS", 50)
    monkeypatch.setattr(crosscheck, "MOST_CHECKED_VALUES", 3)
    values = tuple(np.random.default_rng(1).permutation(1000).tolist())
    axes = (Axis("a", values), Axis("b", tuple(-value for value in values)))
    checked = list(crosscheck._samples_to_check(axes))
    assert {(0, 0), (999, -999)} <= {tuple(sample.values()) for sample in checked}
    assert len(checked) == 3 + 2  # the extremes of both axes are the same two samples


def belts(design=None, **axes):
    document = {"name": "x", "model": "elastic_belt", "scene": {"thrust": 5e4}, "axes": axes}
    return build_job(document | ({"design": design} if design else {}), "x.toml")


def test_a_million_runs_are_shared_out_in_seconds():
    load = {"from": 20.0, "to": 100.0, "count": 1000}
    speed = {"from": 100.0, "to": 500.0, "count": 1000}
    job = belts(load=load, driving_speed=speed)
    began = time.process_time()
    groups = lane_groups(job, range(job.size))
    batches = share_out(groups, run_costs(job), 64)
    # 0.7 s on an idle core; looked at one by one the runs take 85 s
    assert time.process_time() - began < 10.0
    assert sorted(index for batch in batches for index in batch) == [*range(job.size)]


SAMPLES = {"kind": "sobol", "runs": 16, "seed": 1}


@pytest.mark.parametrize(
    "job",
    [
        # the step follows from its error
        belts(
            load=[20.0, 50.0, 80.0],
            friction_memory=[0.0, 1e-4, 3e-4],
            step_error=[0.01, 0.02],
            ratio=[1.0, 2.5],
        ),
        belts(SAMPLES, load={"from": 20.0, "to": 80.0}, rise_time={"from": 0.02, "to": 0.03}),
        belts(SAMPLES, load={"from": 20.0, "to": 80.0}, thrust={"from": 4e4, "to": 5e4}),
    ],
)
def test_runs_of_a_batch_have_one_lane_key(job):
    runs = [index for index in range(job.size) if index % 5]
    wanted = {}
    for index in runs:
        wanted.setdefault(lane_key(job.point(index)), []).append(index)
    assert lane_groups(job, runs) == [tuple(group) for group in wanted.values()]


def test_what_costs_do_not_follow_from_is_not_evaluated(monkeypatch):
    job = belts(load_share=[0.2, 0.4], friction_gradient=[-1.2, -0.8])
    assert [derived.name for derived in job.derived] == ["load"]
    monkeypatch.setattr(definition.Derived, "values", property(lambda self: 1 / 0))
    assert run_costs(job).shape == (4,)


def test_check_start_refuses_as_a_run(tmp_path):
    document = {
        "name": "x",
        "model": "criterion",
        "axes": {
            "contact_force": {"from": 100, "to": 200, "count": 2000},
            "element_mass": {"from": 1, "to": 2, "count": 2000},
            "friction_gradient": {"from": -1, "to": -0.1, "count": 2500},
        },
    }
    with pytest.raises(InputError, match="^x.toml: 10000000000 runs: expected 4 TB of memory"):
        check_start(build_job(document, "x.toml"), tmp_path / "out")
