"""A transient run of the pushbelt on a ring of beams, recorded as one of `pushbelt`."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from cvt_hpc.kernels import called_alike
from cvt_hpc.models.beam_pushbelt import fields as b
from cvt_hpc.models.beam_pushbelt.belt import Proximal
from cvt_hpc.models.beam_pushbelt.parameters import as_pushbelt
from cvt_hpc.models.beam_pushbelt.start import start, workspace
from cvt_hpc.models.beam_pushbelt.step import advance
from cvt_hpc.models.marched import batches_of_one
from cvt_hpc.models.pushbelt import fields as f
from cvt_hpc.models.pushbelt import transient as pushbelt
from cvt_hpc.models.pushbelt.readings import Reading
from cvt_hpc.models.pushbelt.run import OF_LOSS
from cvt_hpc.models.sampled import MOST_UNSOLVED
from cvt_hpc.multibody.rcm_beam import energies
from cvt_hpc.variables import Status

CHANNELS = pushbelt.CHANNELS


class Transient(pushbelt.Transient):
    """One run, as `pushbelt.transient.Transient` has it."""

    def _begin(self, p: Mapping[str, Any]) -> None:
        self._advance = called_alike(advance)
        self._belt, self._state = start(pushbelt.given(as_pushbelt(p)))
        self._work = workspace(self._state.ring, p["elements"])
        self._method = Proximal(p["theta"], p["law_tolerance"], p["most_sweeps"])

    def _reached(self) -> tuple[np.ndarray, ...]:
        elements, ring = self._state.elements, self._state.ring
        return elements, ring.q, ring.u, *self._state[2:], *self._recorded()

    def _elements(self) -> np.ndarray:
        return self._state.elements

    def _stored_energy(self, found: Reading) -> float:
        e, belt, ring = self._state.elements, self._belt, self._state.ring
        kinetic = belt.mass * (e[:, [f.U_Y, f.U_Z]] ** 2).sum()
        kinetic += belt.inertia * (e[:, f.OMEGA] ** 2).sum()
        kinetic += belt.driven_inertia * self._state.pulleys[f.DRIVEN_SPEED] ** 2
        pressed = (e[:, [f.EDGE, f.HEAD]] ** 2).sum() / belt.contact_stiffness
        pressed += 2.0 * (e[:, f.FLANK] ** 2).sum() / belt.flank_stiffness
        parts = range(0, ring.q.size - 3, 5)
        of_ring = sum(sum(energies(ring.beam, ring.q[i : i + 8], ring.u[i : i + 8])) for i in parts)
        return of_ring + 0.5 * float(kinetic + pressed)

    def numerical_doubt(self, record: dict[str, Any]) -> tuple[Status, str] | None:
        """As of `pushbelt`; but the balance holds the damping of steps, which is free for theta above 1/2."""
        unsolved, flow = record["unsolved_share"], max(abs(record["driving_power"]), record["loss"])
        either = (self._most_damped() + OF_LOSS * record["loss"]) / flow
        most = either if self._method.theta <= 0.5 else np.inf
        if not unsolved <= MOST_UNSOLVED:
            why = f"{unsolved:.1%} of the steps were not solved, the last {self._fault()}"
        elif not -either <= record["power_residual"] <= most:
            why = f"the power balance is open by {record['power_residual']:.3g}, not by {either:.3g} or less"
        else:
            return None
        return Status.FAILED_NUMERICS, why

    def counters(self) -> dict[str, int]:
        """Work done so far: steps, sweeps as iterations, unsolved steps, corrections of impulses."""
        return super().counters() | {"corrections": int(self._state.counters[b.CORRECTIONS])}


batch = batches_of_one(Transient)
forget = pushbelt.forget
