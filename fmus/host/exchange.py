"""An FMU for model exchange alone, run as one for co-simulation: CVODE integrates it over each step.

Between two steps it is in event mode, where inputs and tunable parameters of every kind may be set. A step
begins and ends with an update of its discrete states, and stops at every event of state, time or step within.
No step depends on the solver's past, so that a simulation can go on from any state.
"""

from collections.abc import Callable
from ctypes import byref, c_void_p
from math import inf
from typing import Any, ClassVar

from fmpy.fmi1 import FMICallException
from fmpy.fmi2 import FMU2Model
from fmpy.fmi3 import FMU3Model
from fmpy.sundials import CVodeSolver, cvode

from fmus.host.fmi2 import Fmi2Instance
from fmus.host.fmi3 import Fmi3Instance
from fmus.host.instance import PART, Instance
from fmus.host.status import DISCARD, OK, CallFailed
from fmus.host.watch import PAGE

TOLERANCE = 1e-9  # of a state and of its nominal value, of the integration
MOST_EVENTS = 10_000  # within a step, or updates at one event
MOST_STEPS = 100_000  # of the solver within a step
ONE_STEP = 2  # CVODE's CV_ONE_STEP
ROOT = 2  # what CVODE returns where an event indicator has changed its sign

_stop_at: Any = cvode.sundials_cvode.CVodeSetStopTime
_stop_at.argtypes = [c_void_p, cvode.sunrealtype]


class Exchanged(Instance):
    """The steps of an instance for model exchange."""

    COMPILED = False
    UPDATE: ClassVar[str]  # FMPy's names of what the versions of FMI call differently
    SLOPES: ClassVar[str]
    _solver: "_Solver | None" = None
    _next = inf  # s, the next event of time

    def leave(self) -> None:
        """End initialisation, and come to the first discrete states."""
        super().leave()
        if self._update():
            self._asked = self._reason("it asks to end the simulation before it began")

    def stopped(self, t: float, dt: float, status: int) -> int:
        """No compiled loop steps it."""
        return status

    def stepper(self) -> Callable[[float, float], int]:
        """A raw step; see Instance."""

        def step(t: float, dt: float) -> int:
            self.ready()
            if self._update():
                return self._ends(t, dt, t)
            reached = self._integrated(t, dt)
            if reached is not None:
                return self._ends(t, dt, reached)
            self._call(self._slave.enterEventMode)
            return self._ends(t, dt, t + dt) if self._update() else OK

        return step

    def _integrated(self, t: float, dt: float) -> float | None:
        """Go through continuous time; the time at which the FMU asked for the end, s, where it did."""
        now, end, least = t, t + dt, PART * abs(dt)
        if not dt > 0:
            raise CallFailed(f"a step of {dt:g} s is not positive")
        self._call(self._slave.enterContinuousTimeMode)
        solver, events, steps = self._begun(t), 0, 0
        while events < MOST_EVENTS and steps < MOST_STEPS:
            upto = min(end, self._next)
            roots = False
            if upto - now > least:
                roots, now = self._advanced(solver, now, upto)
            else:
                now = max(now, upto)
            at_step, ends = self._call(self._slave.completedIntegratorStep, int(self.final))
            if ends:
                self._call(self._slave.enterEventMode)
                return now
            due = now >= self._next - least
            steps += 1
            if roots or at_step or due:
                events += roots or due
                self._call(self._slave.enterEventMode)
                if self._update():
                    return now
                self._call(self._slave.enterContinuousTimeMode)
                solver.reset(now)
            if now >= end - least:
                return None
        if events < MOST_EVENTS:
            raise CallFailed(
                f"more than {MOST_STEPS} steps of the solver in the step from t = {t:g} s; step less far"
            )
        raise CallFailed(f"more than {MOST_EVENTS} events in the step from t = {t:g} s; its events chatter")

    def _advanced(self, solver: "_Solver", now: float, upto: float) -> tuple[bool, float]:
        """One step of the solver: whether a state event came, and the time reached, at most `upto`, s."""
        PAGE.calling(self.who, "a step by model exchange", now)
        try:
            roots, reached = solver.step(now, upto)
        except Exception as error:  # FMPy raises no class of its own for the solver's failures
            why = solver.trouble or error
            raise CallFailed(self._reason(f"the integration from t = {now:g} s failed ({why})")) from error
        self._call(self._slave.setTime, reached)
        return roots, reached

    def _begun(self, t: float) -> "_Solver":
        """The solver, without a past, at the FMU's states and t, s."""
        self._call(self._slave.setTime, t)
        if self._solver is None:
            self._solver = _Solver(self._slave, self._sizes, getattr(self._slave, self.SLOPES), t)
        self._solver.trouble = None
        self._solver.reset(t)
        return self._solver

    def _update(self) -> bool:
        """In event mode, come to new discrete states; whether the FMU asks for the end."""
        for _ in range(MOST_EVENTS):
            needed, ends, _, _, timed, then = self._call(getattr(self._slave, self.UPDATE))
            if ends:
                return True
            if not needed:
                self._next = float(then) if timed else inf
                return False
        raise CallFailed(f"its discrete states do not settle within {MOST_EVENTS} updates")


class Fmi2Exchange(Exchanged, Fmi2Instance):
    """An instance for model exchange by FMI 2.0."""

    SLAVE = FMU2Model
    UPDATE, SLOPES = "newDiscreteStates", "getDerivatives"


class Fmi3Exchange(Exchanged, Fmi3Instance):
    """An instance for model exchange by FMI 3.0."""

    UPDATE, SLOPES = "updateDiscreteStates", "getContinuousStateDerivatives"

    def _instantiated(self, identity: dict[str, str], log: Any) -> Any:
        model = FMU3Model(**identity)
        PAGE.calling(self.who, "fmi3InstantiateModelExchange")
        model.instantiate(loggingOn=True, logMessage=log)
        return model


class _Held:
    """Inputs for FMPy's solver: they are held over a step."""

    def apply(self, t: float) -> None:
        """Nothing changes."""


class _Solver(CVodeSolver):  # type: ignore[misc]  # FMPy comes without types
    """FMPy's CVODE, step by step, in which a refusal of the FMU becomes one of the step.

    trouble: the last refusal.
    """

    def __init__(self, model: Any, sizes: tuple[int, int], slopes: Callable[..., Any], t: float) -> None:
        self.trouble: FMICallException | None = None
        super().__init__(
            nx=sizes[0],
            nz=sizes[1],
            get_x=model.getContinuousStates,
            set_x=model.setContinuousStates,
            get_dx=slopes,
            get_z=model.getEventIndicators,
            get_nominals=model.getNominalsOfContinuousStates,
            set_time=model.setTime,
            input=_Held(),
            startTime=t,
            relativeTolerance=TOLERANCE,
            maxNumSteps=MOST_STEPS,
        )

    def step(self, t: float, tNext: float) -> tuple[bool, float]:  # by the names of FMPy
        """One step from t s on to tNext at most: whether an event indicator changed, and the time reached, s.

        The FMU has the states reached: it is told of each step that is complete, as FMI asks for.
        """
        reached = cvode.sunrealtype(t)
        _stop_at(self.cvode_mem, tNext)
        status = cvode.CVode(self.cvode_mem, tNext, self.x, byref(reached), ONE_STEP)
        if status < 0:
            raise RuntimeError("{0}: {3}".format(*self.error_info))
        if not self.discrete:
            self.set_x(self.px, self.nx)
        return status == ROOT, reached.value

    def f(self, t: float, y: Any, ydot: Any, data: Any) -> int:
        """The derivatives, or that the solver shall try a shorter step, or give up."""
        return self._tried(super().f, t, y, ydot, data)

    def g(self, t: float, y: Any, gout: Any, data: Any) -> int:
        """The event indicators."""
        return self._tried(super().g, t, y, gout, data)

    def _tried(self, function: Callable[..., int], *args: Any) -> int:
        try:
            return function(*args)
        except FMICallException as error:
            self.trouble = error
            return 1 if error.status == DISCARD else -1
