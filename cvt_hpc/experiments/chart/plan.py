"""The content of a chart: scenes, their judged quantities, and the points to be measured."""

import math
from dataclasses import asdict, dataclass, replace
from enum import Enum
from typing import Any

from cvt_hpc.job import Job
from cvt_hpc.job.definition import digest

_PREFIXES = ((1.0, ""), (1e-3, "m"), (1e-6, "µ"), (1e-9, "n"))


class Role(Enum):
    """The purpose of a point."""

    REFERENCE = "reference"  # the reference of errors
    COARSER = "coarser"  # the same method at a longer step, by which the reference's own error is known
    METHOD = "method"
    BASE = "base"  # the point with which the choices of the error budget are compared
    CHOICE = "choice"


@dataclass(frozen=True)
class Quantity:
    """A result by which methods are judged."""

    name: str  # one of `cvt_hpc.experiments.chart.quantities.KINDS`
    tolerance: float  # largest error that is allowed; inf where there is no limit
    scale: float  # scale of errors [unit of the quantity]; 0: the size of the reference
    # since, until: part of the run [s] that is looked at, where the quantity has one; inf: to the end
    since: float = 0.0
    until: float = math.inf
    channel: str = ""  # recorded channel that shows an onset; "" for other quantities


@dataclass(frozen=True)
class Lead:
    """Run to the state from which the methods of a scene march."""

    job: Job  # the stepper that leads there, with its settings
    until: float  # when the methods take over [s]


@dataclass(frozen=True)
class Scene:
    """One problem on which methods compete."""

    # name, title: for files and for people
    name: str
    title: str
    quantities: tuple[Quantity, ...]  # the judged quantities, in the order of the panels
    starts: int  # number of runs, from as many random starts
    exact: bool  # whether the reference is the model's exact solution
    # core-seconds [s] after which a run is given up, where the chart allows more
    time_limit: float = math.inf
    # the lead-in run that brings all runs, the reference's too, to a state from which they start; only
    # trajectories are judged then
    lead: Lead | None = None


@dataclass(frozen=True)
class Point:
    """One thing to measure: a scene by a method at a step or a tolerance."""

    name: str  # unique in the chart; a file-safe word
    scene: str  # name of its scene
    role: Role  # its purpose
    # series, label: the method or the choice: its name in the job, and for people
    series: str
    label: str
    key: str  # which parameter of the stepper the points of a series differ in; "" where there is none
    job: Job  # the job that is run; with its own seed for the first start, the next ones for the others
    starts: int  # number of runs
    # how many of them advance together; timed ones fill all lanes, if need be with further starts that count
    # for the time alone. 0: as many as the model can, where only results count
    lanes: int = 0
    until: float = math.inf  # how far a run is marched [s]; inf: to its end
    # of a choice: whether it comes nearer to the truth than the base, so that the difference is an error of
    # the base
    refines: bool = False

    @property
    def timed(self) -> bool:
        """Tell whether the cost is of interest."""
        return self.role is Role.METHOD

    @property
    def setting(self) -> float:
        """Return the value of the parameter `key` [SI]; nan where there is none."""
        return float(self.job.parameters[self.key]) if self.key else math.nan

    @property
    def setting_in_words(self) -> str:
        """Return the setting for people, such as "3 µs"; "" where there is none."""
        if not self.key:
            return ""
        schema = self.job.schema
        if schema.parameters[self.key].unit != "s":
            return schema.in_words(self.key, self.setting)
        factor, prefix = next((pair for pair in _PREFIXES if abs(self.setting) >= pair[0]), _PREFIXES[-1])
        return f"{self.setting / factor:.4g} {prefix}s"

    def parameters(self, start: int) -> dict[str, Any]:
        """Return the flat parameters [SI] of one of the runs."""
        return start_parameters(self.job, start)


def start_parameters(job: Job, start: int) -> dict[str, Any]:
    """Return the flat parameters [SI] of a job's run from one of its random starts."""
    if start == 0:
        return dict(job.parameters)
    return {**job.parameters, "seed": job.parameters["seed"] + start}


@dataclass(frozen=True)
class Chart:
    """A validated chart job."""

    job: Job  # the job of the first point, which has the chart's name and description
    source: str  # the job file
    scenes: tuple[Scene, ...]  # the problems
    points: tuple[Point, ...]  # all points, references first
    repeats: int  # how often a quick run is timed
    time_limit: float  # core-seconds [s] after which a run is given up
    budgeted: tuple[str, ...] = ()  # quantities that the error budget shows

    def scene(self, name: str) -> Scene:
        """Return the scene of a name."""
        return next(scene for scene in self.scenes if scene.name == name)

    def points_of(self, scene: str, *roles: Role) -> tuple[Point, ...]:
        """Return the points of a scene in certain roles."""
        return tuple(point for point in self.points if point.scene == scene and point.role in roles)

    def resolved(self) -> dict[str, Any]:
        """Return all entries that determine the measurements, as JSON types."""
        return {
            "name": self.job.name,
            "description": self.job.description,
            "repeats": self.repeats,
            "time_limit": self.time_limit,
            "budgeted": list(self.budgeted),
            "scenes": {scene.name: _scene_to_json(scene) for scene in self.scenes},
            "points": {
                point.name: {
                    "role": point.role.value,
                    "label": point.label,
                    "starts": point.starts,
                    "lanes": point.lanes,
                    "until": _to_json(point.until),
                    "refines": point.refines,
                    "job": _job_to_json(point.job),
                }
                for point in self.points
            },
        }

    def fingerprint(self) -> str:
        """Return the SHA-256 [hex] of `resolved`; name and description do not count."""
        return digest({**self.resolved(), "name": "", "description": ""})


def _scene_to_json(scene: Scene) -> dict[str, Any]:
    lead = {"until": scene.lead.until, "job": _job_to_json(scene.lead.job)} if scene.lead else None
    return {**_to_json(asdict(replace(scene, lead=None))), "lead": lead}


def _job_to_json(job: Job) -> dict[str, Any]:
    return {**job.resolved(), "name": "", "description": ""}


def _to_json(value: Any) -> Any:
    """Return a value without the infinities that JSON lacks, and without tuples."""
    if isinstance(value, dict):
        return {key: _to_json(item) for key, item in value.items()}
    if isinstance(value, (tuple, list)):
        return [_to_json(item) for item in value]
    return str(value) if isinstance(value, float) and math.isinf(value) else value
