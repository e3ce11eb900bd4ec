"""The interface of a model to the rest of the program, and `load_model`, the way to it by the model's name.

Parts of certain models answer questions that no other model answers, such as the branch of steady states; the
README lists the rooms that import such parts themselves.

A model is a package of up to four modules. All but the first are imported only when they are needed:

- the package itself (`Declaration`): the parameters that a job may set; cheap to import;
- `record` (`Recorded`): the variables of a record, the cost of a run, and the verdict on a run. A model
  without it is there to compare steppers. A model without a transient offers `solve` there;
- `transient` (`Transient`): runs that march;
- `exact`: `exact(parameters, times)`, the displacement (time, probe) [m] in closed form.

A model leaves out the members that it does not need; `Model` has the default of each such member.

A model with a transient may answer some runs without all of it. Its `record` then has `known(parameters)`,
the values where no transient is needed, else None; `preliminary(parameters)`, the parameters of a cheaper
transient that comes first, or None; and `settle(run)`, the values by that transient if it answers, else None.

The `record` of a model whose runs cost little has `judge_together(runs)` and, without a transient,
`solve_together(points)`, for all runs of a batch at once: of one `lane_key`, `lanes` at most. A run's values
are those of `judge` and `solve`, to the bit.

If the runs of a `transient` keep a part of their march for later runs of the process, it has `forget()`,
which drops that part.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import cached_property
from importlib import import_module
from importlib.util import find_spec
from types import ModuleType
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from cvt_hpc.errors import InputError
from cvt_hpc.models import MODELS
from cvt_hpc.parameters import Parameter, Parameters
from cvt_hpc.variables import Coordinate, Failure, Values, Variable

if TYPE_CHECKING:
    import xarray as xr

PILOT_SHARE = 0.25  # of a run's simulated time: a forecast runs this part


class Probe(Protocol):
    """A place where displacement is recorded."""

    @property
    def label(self) -> str:
        """Name of the strand or arc and a number, or of the body."""


class Run(Protocol):
    """One run of a batch.

    Attributes
    ----------
    interval : float
        Sampling interval [s].
    samples, done : int
        Samples of the whole run, and those recorded so far, up to the one at which it failed.
    """

    interval: float
    samples: int

    @property
    def parameters(self) -> Parameters:
        """Resolved parameters, the stepper's among them."""

    @property
    def probes(self) -> Sequence[Probe]:
        """Places at which displacement is recorded."""

    @property
    def done(self) -> int:
        """Samples recorded so far."""

    @property
    def failure(self) -> Failure | None:
        """Reason why the run cannot continue: a failure, or a result, with the status done."""

    @property
    def time(self) -> float:
        """Simulated time [s]."""

    @property
    def step(self) -> float:
        """Time step, of adaptive methods the mean [s]."""

    @property
    def steps(self) -> int:
        """Steps taken so far."""

    @property
    def contact_solves(self) -> int:
        """Linear solves of the contact problem so far."""

    @property
    def displacement(self) -> np.ndarray:
        """Displacement at the probes, (done, probe) [m]."""

    def channel(self, name: str) -> np.ndarray:
        """History of one of the model's channels, (done,)."""

    def counters(self) -> dict[str, int]:
        """Work done so far, by its name."""

    def numerical_doubt(self, record: Values) -> Failure | None:
        """Why a run that reached its end is not to be trusted, by its values; None where it is."""

    def paused(self) -> Any:
        """The state from which a batch of the same point over a longer time continues."""


class Batch(Protocol):
    """Runs that advance together."""

    interval: float
    samples: int

    @property
    def runs(self) -> Sequence[Run]:
        """In the order of their points."""

    @property
    def done(self) -> int:
        """Samples taken so far."""

    @property
    def running(self) -> bool:
        """Whether any run has not ended."""

    def advance(self, samples: int) -> None:
        """March on by so many samples at most; 0 compiles or loads the kernels only."""

    def take_over(self, runs: Sequence[Any]) -> None:
        """Continue from the state of runs by another stepper; for models with TAKES_OVER."""


class Declaration(Protocol):
    """The package of a model: the parameters that a job may set. Its docstring's first line is its title.

    It may also have `check(parameters)`, which yields (key, expected, found) of conflicts between parameters;
    `inert(parameters)`, the keys without effect with the reason of each; `GIVES`, by stepper and key how a
    key of the stepper is derived for this model (`cvt_hpc.parameters.Substitute`); `REFUSED`, steppers that
    it does not take, each with the reason; `ANSWERED_BY`, questions that another model answers, each with
    that model's name and the reason; `COMPARED`, variables of the record, numbers per run or per strand or
    pulley, that are compared between two studies beside class, amplitude and frequency; and `KICK`, the
    parameter that gives the belt a push at an instant of a run, 0 for none, with a small value [SI].
    """

    @property
    def PARAMETERS(self) -> dict[str, dict[str, Parameter]]:  # noqa: N802
        """Parameters by table and key; a key of all runs may stand here with the model's own default."""

    @property
    def DEFAULT_STEPPER(self) -> str | None:  # noqa: N802
        """The model's default stepper; None: there is no transient."""

    @property
    def STEPPERS(self) -> Mapping[str, str]:  # noqa: N802
        """Modules that declare steppers, by name; a step of the model's own lives with the model."""


class Recorded(Protocol):
    """The module `record` of a model."""

    @property
    def VARIABLES(self) -> tuple[Variable, ...]:  # noqa: N802
        """Variables of the record beside verdict and cost."""

    def coordinates(self, parameters: Parameters) -> dict[str, Coordinate]:
        """Dimensions of the record beside the grid's."""

    def cost(self, parameters: Parameters, stepper: Any) -> Any:
        """Core-seconds of a batch with full lanes; of parameters that are arrays, an array."""

    def judge(self, run: Any) -> Values:
        """Values of VARIABLES and the verdict of a run at its end, or of the result of `solve`."""


class Transient(Protocol):
    """The module `transient` of a model."""

    @property
    def CHANNELS(self) -> tuple[str, ...]:  # noqa: N802
        """Names of the histories that runs record beside displacement."""

    @property
    def batch(self) -> Callable[..., Batch]:
        """`batch(points, stepper, paused=())`: runs from their starts, or from where shorter ones ended."""


class Model:
    """A model of the ladder: everything that the rest of the program may use of it.

    Parameters
    ----------
    name : str
        A name in `cvt_hpc.models.MODELS`.
    """

    def __init__(self, name: str) -> None:
        self.name = name
        self._declared: Any = import_module(MODELS[name])

    @property
    def title(self) -> str:
        """Title of the model in one line: the first line of its package's docstring."""
        return (self._declared.__doc__ or "").strip().split("\n")[0]

    @property
    def parameters(self) -> dict[str, dict[str, Parameter]]:
        """Parameters that a job may set, by table and key."""
        return self._declared.PARAMETERS

    @property
    def default_stepper(self) -> str | None:
        """The model's default stepper; None for a model without a transient."""
        return self._declared.DEFAULT_STEPPER

    @property
    def steppers(self) -> Mapping[str, str]:
        """Steppers that the model takes, by name the module that declares them."""
        return self._declared.STEPPERS

    @property
    def refused(self) -> Mapping[str, str]:
        """Steppers that the model does not take, and why."""
        return _member(self._declared, "REFUSED", {})

    @property
    def gives(self) -> Mapping[str, Mapping[str, Any]]:
        """Parameters from which the value of a key is derived for this model, by stepper and key."""
        return _member(self._declared, "GIVES", {})

    @property
    def answered_by(self) -> Mapping[str, tuple[str, str]]:
        """Questions that another model answers: its name, and the reason."""
        return _member(self._declared, "ANSWERED_BY", {})

    @property
    def compared(self) -> tuple[str, ...]:
        """Variables that are compared between two studies beside class, amplitude and frequency."""
        return _member(self._declared, "COMPARED", ())

    @property
    def kick(self) -> tuple[str, float] | None:
        """Parameter that gives the belt a push at an instant of a run, and a small value of it [SI]."""
        return _member(self._declared, "KICK", None)

    @property
    def check(self) -> Callable[[Parameters], Any]:
        """Yields (key, expected, found) of parameters that do not fit together."""
        return _member(self._declared, "check", lambda parameters: ())

    @property
    def inert(self) -> Callable[[Parameters], dict[str, str]]:
        """Keys without effect beside others, and why."""
        return _member(self._declared, "inert", lambda parameters: {})

    @property
    def is_recorded(self) -> bool:
        """Whether runs are judged and recorded; else the model is there to compare steppers."""
        return self._offers("record")

    @property
    def has_exact(self) -> bool:
        """Whether there is a solution in closed form."""
        return self._offers("exact")

    @property
    def variables(self) -> tuple[Variable, ...]:
        """Variables of a record beside verdict and cost."""
        return self._record.VARIABLES

    def coordinates(self, parameters: Parameters) -> dict[str, Coordinate]:
        """Dimensions of the record beside the grid's."""
        return self._record.coordinates(parameters)

    def cost(self, parameters: Parameters, stepper: str | None) -> Any:
        """Core-seconds of a batch with full lanes; of parameters that are arrays, an array."""
        return self._record.cost(parameters, stepper)

    def lanes(self, parameters: Parameters, stepper: str | None) -> int:
        """Most runs that can advance together."""
        if not self.is_recorded:
            return 1
        return _member(self._record, "lanes", lambda parameters, stepper: 1)(parameters, stepper)

    def lane_key(self, parameters: Parameters) -> tuple:
        """Values that all runs of one batch have in common."""
        return _member(self._record, "lane_key", lambda parameters: ())(parameters)

    @property
    def pilot_share(self) -> float:
        """Share of a run's simulated time from which the cost of the whole run is estimated."""
        return _member(self._record, "PILOT_SHARE", PILOT_SHARE)

    def known(self, parameters: Parameters) -> Values | None:
        """Values of a run that needs no transient; None for a run that needs one."""
        return _member(self._record, "known", lambda parameters: None)(parameters)

    def preliminary(self, parameters: Parameters) -> Values | None:
        """Parameters of a cheaper transient that comes first; None where there is none."""
        return _member(self._record, "preliminary", lambda parameters: None)(parameters)

    def settle(self, run: Run) -> Values | None:
        """Values of a run by its cheaper transient if that answers, else None."""
        return self._record.settle(run)

    def judge(self, run: Any) -> Values:
        """Values and verdict of a run at its end, or of the result of `solve`."""
        return self._record.judge(run)

    def judge_together(self, runs: Sequence[Any]) -> list[Values]:
        """Values and verdicts of runs of one batch, each as `judge` gives them to the bit."""
        if not runs:
            return []
        return _member(self._record, "judge_together", lambda runs: list(map(self.judge, runs)))(runs)

    def solve(self, parameters: Parameters) -> Any:
        """Result that `judge` and `histories` read, for a model without a transient."""
        return self._record.solve(parameters)

    def solve_together(self, points: Sequence[Parameters]) -> list[Any]:
        """Results of several runs, each as `solve` gives it to the bit."""
        return _member(self._record, "solve_together", lambda points: list(map(self.solve, points)))(points)

    def profile_bytes(self, parameters: Parameters) -> int:
        """Size of a kept history's values along the belt at each sample [byte]."""
        return _member(self._record, "profile_bytes", lambda parameters: 0)(parameters)

    @property
    def has_histories(self) -> bool:
        """Whether `simulate` has anything beyond the record."""
        return self.default_stepper is not None or self.is_recorded and hasattr(self._record, "histories")

    def histories(self, run: Any) -> xr.Dataset:
        """Data of `simulate` beyond the record, of a run or of the result of `solve`."""
        import xarray as xr

        return _member(self._record, "histories", lambda run: xr.Dataset())(run)

    @property
    def channels(self) -> tuple[str, ...]:
        """Names of the histories that runs record beside displacement."""
        return self._transient.CHANNELS

    @property
    def takes_over(self) -> bool:
        """Whether runs can continue from the state of runs by another stepper."""
        return _member(self._transient, "TAKES_OVER", False)

    def batch(self, points: Sequence[Parameters], stepper: str | None, paused: Sequence[Any] = ()) -> Batch:
        """Runs that advance together, from their starts or from where shorter ones ended."""
        return self._transient.batch(points, stepper, paused)

    def forget(self) -> None:
        """Discard cached results so that the next run is computed in full.

        Its time is used to predict others.
        """
        if self._offers("transient"):
            _member(self._transient, "forget", lambda: None)()

    def exact(self, parameters: Parameters, times: np.ndarray) -> np.ndarray:
        """Displacement in closed form, (time, probe) [m].

        Raises
        ------
        InputError
            If there is none for these parameters.
        """
        return self._module("exact").exact(parameters, times)

    def check_recorded(self, source: str) -> None:
        """Raise InputError if runs are not judged and recorded; `source` is the file that needs it."""
        if not self.is_recorded:
            known = ", ".join(name for name in MODELS if load_model(name).is_recorded)
            raise InputError(
                f"{source}: model: expected one whose runs are judged and recorded ({known}), "
                f"found {self.name}, which is there to compare steppers: `cvt-hpc chart`"
            )

    @cached_property
    def _record(self) -> Any:
        return self._module("record")

    @cached_property
    def _transient(self) -> Any:
        return self._module("transient")

    def _module(self, name: str) -> ModuleType:
        return import_module(f"{MODELS[self.name]}.{name}")

    def _offers(self, name: str) -> bool:
        try:
            return find_spec(f"{MODELS[self.name]}.{name}") is not None
        except ModuleNotFoundError:  # a model that is one module
            return False


def _member(module: Any, name: str, default: Any) -> Any:
    return vars(module).get(name, default)


def load_model(name: str) -> Model:
    """Return a model of the ladder.

    Parameters
    ----------
    name : str
        A name in `cvt_hpc.models.MODELS`.
    """
    return Model(name)
