"""Each check of what papers state turns where physics is turned: strands swapped, signs and runs reversed."""

import json

import numpy as np
import pytest

from cvt_hpc.papers.figures import FIGURES
from cvt_hpc.papers.verdicts import Kept, Verdict, judged
from cvt_hpc.variables import Vibrates
from support import stated


def histories(change):
    """A break of each history."""
    return lambda kept: Kept(kept.results, [change(history.copy(deep=True)) for history in kept.histories])


def results(change):
    """A break of the results."""
    return lambda kept: Kept(change(kept.results.copy(deep=True)), kept.histories)


def scaled(name, factor):
    def change(dataset):
        dataset[name] = factor * dataset[name]
        return dataset

    return change


def backwards(name):
    """A quantity by place, the other way round along both arcs."""

    def change(history):
        values = history[name].values
        for first in (stated.FIRST["driving"], stated.FIRST["driven"]):
            values[first : first + stated.ARC + 1] = values[first : first + stated.ARC + 1][::-1].copy()
        return history

    return change


def level(name):
    """A quantity at its mean everywhere."""

    def change(dataset):
        dataset[name] = dataset[name] * 0.0 + float(dataset[name].mean())
        return dataset

    return change


def tilted(name):
    """A quantity that rises from place to place."""

    def change(history):
        history[name] = history[name] * (1.0 + np.arange(stated.NAMES.size))
        return history

    return change


def as_tension(name):
    """A force that follows the tension, without peaks."""
    return lambda history: history.assign({name: 20.0 * history["tension"]})


def one_sided(name):
    """Forces that point the same way at both pulleys."""
    return lambda dataset: dataset.assign({name: abs(dataset[name])})


def added(name, value):
    def change(dataset):
        dataset[name] = dataset[name] + value
        return dataset

    return change


def cut_off(name):
    """A quantity that ends half-way through the driven arc."""

    def change(history):
        history[name].values[stated.FIRST["driven"] + stated.ARC // 2 :] = 0.0
        return history

    return change


def strands_swapped(*names):
    def change(dataset):
        for name in names:
            dataset[name] = dataset[name].copy(
                data=np.flip(dataset[name].values, dataset[name].dims.index("strand"))
            )
        return dataset

    return change


def runs_swapped(kept):
    """What one run shows at the place of another, in reverse order."""
    points = [history.attrs["point"] for history in kept.histories]
    swapped = [h.assign_attrs(point=point) for h, point in zip(kept.histories, points[::-1], strict=True)]
    return Kept(kept.results, swapped)


def runs_exchanged(kept):
    """As `runs_swapped`, the first run and the one before the last."""
    points = [history.attrs["point"] for history in kept.histories]
    points[0], points[-2] = points[-2], points[0]
    points[-1], points[-2] = points[-2], points[-1]
    swapped = [h.assign_attrs(point=point) for h, point in zip(kept.histories, points, strict=True)]
    return Kept(kept.results, swapped)


def along_swapped(dim, *names):
    """Results in reverse order along an axis."""

    def change(dataset):
        for name in names:
            dataset[name] = dataset[name].copy(
                data=np.flip(dataset[name].values, dataset[name].dims.index(dim))
            )
        return dataset

    return change


def with_point(**values):
    def change(history):
        return history.assign_attrs(point=json.dumps(json.loads(history.attrs["point"]) | values))

    return change


def with_job(**values):
    """Other values of parameters in the job."""

    def change(dataset):
        job = json.loads(dataset.attrs["job"])
        (table,) = (of for of in job.values() if isinstance(of, dict) and values.keys() <= of.keys())
        table |= values
        return dataset.assign_attrs(job=json.dumps(job))

    return change


def steady(history):
    """An element that does not swing."""
    name = "momentary_radial_sliding"
    history[name] = history[name] - history[name] + history["radial_sliding"]
    return history


def everywhere(name):
    """A vibration over the whole ramp."""

    def change(history):
        time = history["time"].values
        size = 1.2e-5 * np.sin(2 * np.pi * 550.0 * time)
        history[name] = history[name] * 0.0 + (size[:, None] if history[name].ndim == 2 else size)
        return history

    return change


def lowest_load(dataset):
    dataset["vibrates"][0] = Vibrates.YES
    return dataset


SPECTRA = (
    results(strands_swapped("spectrum", "eigenfrequency")), results(level("spectrum")),
    results(strands_swapped("spectrum", "eigenfrequency")),
    results(along_swapped("frequency_bin", "spectrum")),
)  # fmt: skip
# what is broken, by figure and in the order of its statements
BREAKS = {
    "bullinger_04": (
        histories(scaled("radial_sliding", 0.0)), runs_swapped, histories(scaled("radial_sliding", 0.0)),
    ),
    "bullinger_05": (
        results(strands_swapped("mean_ring_tension")), results(strands_swapped("mean_push_force")),
        results(strands_swapped("mean_push_force")), results(scaled("load", -1.0)),
    ),
    "bullinger_20": (
        histories(added("push_force", 100.0)), histories(scaled("ring_friction", -1.0)), runs_swapped,
        histories(backwards("push_force")), histories(level("friction_force")),
        histories(level("ring_friction")), histories(tilted("push_force")),
        histories(cut_off("push_force")), histories(backwards("push_force")),
    ),
    "bullinger_21": (
        histories(scaled("mean_displacement", -1.0)), histories(scaled("tangential_sliding", -1.0)),
        histories(backwards("sliding_angle")), histories(backwards("push_force")), runs_swapped,
        results(added("mean_push_force", 500.0)),
    ),
    "bullinger_22": (
        results(strands_swapped("mean_push_force")), runs_swapped, histories(added("sliding_angle", np.pi / 2)),
    ),
    "bullinger_23": (
        histories(tilted("normal_force")), histories(level("normal_force")),
        histories(backwards("normal_force")), histories(level("normal_force")), runs_swapped,
        runs_exchanged,
    ),
    "lebrecht_3_1": (histories(level("driving_moment")),),
    "lebrecht_3_2": (
        results(lowest_load), results(scaled("frequency", 2.0)), results(strands_swapped("peak_mode")),
    ),
    "lebrecht_3_6": (
        results(strands_swapped("mean_ring_tension")), results(strands_swapped("mean_push_force")),
    ),
    "lebrecht_3_7": (
        results(strands_swapped("eigenfrequency")), results(scaled("eigenfrequency", 1.5)),
    ),
    "lebrecht_3_9": (histories(everywhere("displacement")), histories(scaled("displacement", 3.0))),
    "lebrecht_3_10": (results(scaled("peak_frequency", 1.5)),),
    "lebrecht_3_11": (
        results(scaled("peak_frequency", 0.5)), results(scaled("peak_frequency", 2.0)),
        results(strands_swapped("peak_amplitude")),
    ),
    "lebrecht_3_12": (
        lambda kept: Kept(kept.results.assign_coords(friction_gradient=[0.0, 0.0, 0.0]), []),
        results(along_swapped("friction_gradient", "vibrates")),
        results(along_swapped("friction_gradient", "growth_rate")),
    ),
    "lebrecht_3_13": (runs_swapped, histories(everywhere("displacement"))),
    "lebrecht_3_14": (
        histories(scaled("displacement", 0.0)), histories(scaled("displacement", 0.0)), runs_swapped,
        histories(everywhere("displacement")), runs_swapped,
    ),
    "lebrecht_4_1": (
        histories(scaled("mean_displacement", -1.0)), histories(scaled("radial_sliding", -1.0)),
    ),
    "lebrecht_4_2": (
        histories(scaled("momentary_radial_sliding", -1.0)), histories(steady),
        histories(with_point(stribeck_velocity=5.0, friction_speed=5.0)),
    ),
    "lebrecht_4_4": (
        histories(scaled("radial_sliding", -1.0)), runs_swapped, runs_swapped,
    ),
    "push_force": (
        histories(added("push_force", 100.0)), histories(backwards("push_force")),
        histories(backwards("push_force")), histories(scaled("ring_tension", -1.0)), runs_swapped, runs_swapped,
        histories(tilted("push_force")),
    ),
    "spatial_push_force": (
        histories(added("head_force_left", 100.0)), histories(scaled("head_force_left", 0.0)),
        histories(tilted("push_force")),
    ),
    "clamping": (
        results(scaled("loss", 2.0)), results(along_swapped("thrust", "flank_loss")),
        results(along_swapped("thrust", "ring_loss")), results(along_swapped("thrust", "efficiency")),
    ),
    "belt_drive_friction": (results(with_job(table_mu=[[0.5] * 3] * 3)),),
    "belt_drive": (results(scaled("speed_loss", 0.5)), results(scaled("vibrates", 0))),
    "belt_drive_tension": (
        histories(as_tension("normal_force")), histories(as_tension("friction_force")),
        results(along_swapped("bending_stiffness", "strand_tension")),
    ),
    "belt_drive_spectra": SPECTRA,
    "belt_drive_roughness": SPECTRA,
    "serpentine": (
        histories(with_point(ripple_frequency=80.0)), histories(scaled("tension_P3-P4", 10.0)),
        histories(scaled("arm_T2", 0.0)), histories(scaled("speed_P5", 0.9)),
    ),
    "misalignment": (
        results(one_sided("net_axial_force")), results(along_swapped("misalignment", "largest_roll")),
        results(along_swapped("misalignment", "loss")),
    ),
}  # fmt: skip


def test_every_statement_is_broken_once():
    assert {name: len(breaks) for name, breaks in BREAKS.items()} == {
        name: len(figure.statements) for name, figure in FIGURES.items()
    }


@pytest.mark.parametrize("name", FIGURES)
def test_all_that_is_stated_is_found_where_it_holds(name):
    kept = getattr(stated, name)()
    found = [judged(statement, kept) for statement in FIGURES[name].statements]
    assert [(f.text, f.numbers) for f in found if f.verdict is not Verdict.REPRODUCED] == []


@pytest.mark.parametrize(
    ("name", "k"), [(name, k) for name, all_of in BREAKS.items() for k in range(len(all_of))]
)
def test_a_verdict_turns_with_the_physics(name, k):
    broken = BREAKS[name][k](getattr(stated, name)())
    statement = FIGURES[name].statements[k]
    assert judged(statement, broken).verdict in (Verdict.PARTLY, Verdict.NOT), statement.text
