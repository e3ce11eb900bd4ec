"""Maps of traces and of samples: what is inferred never looks like a run, and each sample stands at its place."""

import numpy as np
import pytest
from PIL import Image

from cvt_hpc.analysis.cells import INFERRED_VIBRATION, LINES, STYLES
from cvt_hpc.analysis.classes import OccurrenceClass, map_classes, occurrence_classes
from cvt_hpc.analysis.figures import draw
from cvt_hpc.analysis.maps import map_figure
from cvt_hpc.analysis.scatter import is_sampled, scatter_figure
from cvt_hpc.errors import InputError
from support.studies import GRADIENTS, LOADS, fills_of, sampled, study, traced

QUIET, VIBRATING, UNDECIDED, FAILED, NOT_RUN, SLIPPING, IRREGULAR = OccurrenceClass
SOFT = {"sheave_stiffness": 1.0}


def trace_panel():
    """The figure of one panel of a trace, the panel, and the classes of its cells."""
    figure = map_figure(traced(), SOFT, "out/x")
    return figure, figure.axes[0], occurrence_classes(study().sel(SOFT)).values


def test_a_map_shows_the_class_of_a_run_or_the_inferred_one():
    dataset = traced()
    assert (map_classes(dataset) == occurrence_classes(study())).all()
    assert map_classes(study()).identical(occurrence_classes(study()))
    # an inferred class never replaces that of a run
    dataset["inferred_class"][:] = FAILED
    done = occurrence_classes(dataset) != NOT_RUN
    assert (map_classes(dataset).values[done] == occurrence_classes(study()).values[done]).all()


def test_only_runs_are_marked_and_inferred_cells_have_lines():
    figure, axes, _ = trace_panel()
    marked = {x for line in axes.lines for x in line.get_xdata()}
    assert marked == set(LOADS[::3])
    (lined,) = [cells for cells in axes.patches if cells.get_hatch() == LINES["hatch"]]
    inside = {x for x in LOADS for y in GRADIENTS if lined.get_path().contains_point((x, y))}
    assert inside == set(LOADS) - marked
    assert len(lined.get_path().vertices) == 5 * 3 * len(GRADIENTS)  # a rectangle around two cells each
    texts = [text.get_text() for text in figure.legends[0].get_texts()]
    assert texts[-3:-1] == ["inferred", "inferred, vibrating"]


def test_inferred_vibration_has_a_colour_of_its_own():
    _, axes, classes = trace_panel()
    fills = fills_of(axes)
    expected = np.count_nonzero(classes[:, np.arange(len(LOADS)) % 3 > 0] == VIBRATING)
    assert expected > 5
    assert fills[INFERRED_VIBRATION] == expected
    assert fills[STYLES[VIBRATING].fill] == 0


def test_runs_and_inferred_cells_are_counted_apart():
    figure, _, classes = trace_panel()
    first, second = np.split(classes[:, np.argsort(np.arange(10) % 3 > 0, kind="stable")], [4], axis=1)
    lines = figure.get_suptitle().splitlines()
    assert lines[1].startswith("12 runs: ") and lines[2].startswith("18 cells inferred: ")
    for line, part in zip(lines[1:], (first, second), strict=False):
        for kind in OccurrenceClass:
            count = np.count_nonzero(part == kind)
            assert (f"{count} {kind.label}" in line) == (count > 0)


def test_a_full_grid_says_nothing_of_inference():
    figure = map_figure(study(), SOFT, "out/x")
    assert "inferred" not in figure.get_suptitle()
    assert "inferred" not in [text.get_text() for text in figure.legends[0].get_texts()]


# Samples


def test_samples_are_told_from_a_grid():
    assert is_sampled(sampled())
    assert not is_sampled(study())
    assert not is_sampled(study().isel(friction_gradient=0, sheave_stiffness=0))


def test_every_sample_is_marked_at_its_place_by_its_class():
    dataset = sampled().isel(run=slice(0, 40))
    dataset = dataset.drop_vars("sheave_stiffness")
    (panel,) = [
        axes for axes in scatter_figure(dataset, {}, "out/x").axes if axes.get_label() != "<colorbar>"
    ]
    assert (panel.get_xlabel(), panel.get_ylabel()) == ("load [N m]", "friction gradient [s/m]")
    classes = occurrence_classes(dataset).values
    by_label = {marks.get_label(): marks.get_offsets() for marks in panel.collections}
    assert set(by_label) == {kind.label for kind in OccurrenceClass if (classes == kind).any()}
    for kind in OccurrenceClass:
        places = [
            (float(r["load"]), float(r["friction_gradient"])) for r in map(dataset.isel, of(classes, kind))
        ]
        assert sorted(map(tuple, by_label.get(kind.label, []))) == sorted(places)


def of(classes, kind):
    return [{"run": int(run)} for run in np.flatnonzero(classes == kind)]


def test_a_panel_for_each_pair_of_axes():
    panels = [
        axes for axes in scatter_figure(sampled(), {}, "out/x").axes if axes.get_label() != "<colorbar>"
    ]
    shown = [(axes.get_xlabel(), axes.get_ylabel()) for axes in panels if axes.axison]
    load, gradient, stiffness = "load [N m]", "friction gradient [s/m]", "sheave stiffness"
    assert shown == [(load, gradient), (load, stiffness), (gradient, stiffness)]
    alone = sampled().drop_vars(["sheave_stiffness", "friction_gradient"])
    (axes,) = [axes for axes in scatter_figure(alone, {}, "out/x").axes if axes.get_label() != "<colorbar>"]
    assert (axes.get_xlabel(), axes.get_ylabel()) == (load, "")


def test_axes_are_spread_as_their_samples_are():
    dataset = sampled().isel(run=slice(0, 30))
    dataset["sheave_stiffness"] = "run", np.geomspace(1.0, 3.0, 30), {"spacing": "log"}
    figure = scatter_figure(dataset, {}, "out/x")
    panels = [axes for axes in figure.axes if axes.axison and axes.get_label() != "<colorbar>"]
    scales = {axes.get_ylabel(): (axes.get_xscale(), axes.get_yscale()) for axes in panels}
    assert scales == {"friction gradient [s/m]": ("linear", "linear"), "sheave stiffness": ("linear", "log")}
    figure.draw_without_rendering()
    texts = [text.get_text() for text in panels[1].get_yticklabels()]
    assert {"1", "1.5", "2", "3"} <= set(texts)


def test_of_many_axes_the_first_are_drawn_and_that_is_said():
    dataset = sampled().assign_coords({name: ("run", np.arange(120.0)) for name in ("ratio", "thrust")})
    figure = scatter_figure(dataset, {}, "out/x")
    assert len([axes for axes in figure.axes if axes.axison and axes.get_label() != "<colorbar>"]) == 6
    assert "the first 4 of 5 axes" in figure.get_suptitle()


def test_samples_are_drawn_by_the_same_call_as_grids(tmp_path):
    finite = sampled().where(np.isfinite(sampled()["sheave_stiffness"]), drop=True)
    with Image.open(draw(lambda: map_figure(finite), tmp_path / "map.png")) as picture:
        assert len(picture.convert("RGB").getcolors(1 << 20)) > 20
    with pytest.raises(InputError, match="^x.nc: at load: expected results over a grid, found samples"):
        draw(lambda: map_figure(finite, {"load": 20.0}, "x.nc"), tmp_path / "other.png")
    assert not (tmp_path / "other.png").exists()
