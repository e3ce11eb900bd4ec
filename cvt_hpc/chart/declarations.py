"""Keys of a chart job beside the tables of a job: [chart] and the tables in it."""

import math

from cvt_hpc.parameters import Parameter, positive

CHART = {
    "repeats": Parameter(3, "", "how often a quick run is timed; the shortest time counts", minimum=1),
    "time_limit": positive(
        300.0, "s", "core-seconds after which a run is given up", sensible=(0.01, 100000.0)
    ),
}
LEAD = {
    "stepper": Parameter(None, "", "stepper"),
    "until": positive(None, "s", "when the methods take over", sensible=(1e-05, 1000.0)),
}
SCENE = {
    "time_limit": positive(
        math.inf,
        "s",
        "core-seconds after which a run of this scene is given up, where the chart allows more",
        sensible=(0.01, 100000.0),
        allow_infinite=True,
    ),
    "title": Parameter("", "", "heading of the scene's picture"),
    "model": Parameter(
        "", "", "model, where it is not that of the job; the job's own tables then do not count"
    ),
    "starts": Parameter(
        1, "", "runs from as many random starts; results are pooled", minimum=1, maximum=1024
    ),
}
METHOD = {
    "label": Parameter("", "", "name in tables and pictures"),
    "stepper": Parameter(None, "", "stepper"),
    "model": Parameter("", "", "model, where it is not the scene's; it is told all that the scene sets"),
    "lanes": Parameter(1, "", "runs that advance together; costs are those of one", minimum=1, maximum=64),
}
BUDGET = {
    "label": Parameter("the base", "", "what the choices are compared with, for people"),
    "scene": Parameter("", "", "scene whose errors are taken apart"),
    "stepper": Parameter("", "", "stepper of the base and, unless they say otherwise, of all choices"),
}
CHOICE = {
    "label": Parameter("", "", "name in tables and pictures"),
    "stepper": Parameter(
        "", "", "stepper, where it is not the base's; what the base sets then does not count"
    ),
    "model": Parameter("", "", "model, where it is not the scene's; it is told all that the scene sets"),
    "starts": Parameter(0, "", "the first of the scene's starts, so many; 0: all", minimum=0),
    "refines": Parameter(
        False, "", "nearer to the truth than the base: the difference is an error of the base"
    ),
}
SETTINGS = ("step", "tolerance")  # keys in which the points of a series may differ
