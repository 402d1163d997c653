"""One step of an assembled model: base, drive and effects on the gut or on a plate, in CasADi symbols."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from models.assembly.effects import Active
from models.drives.drive import Actuation, Drive, Push
from models.drives.elastic_link import Link
from models.effects.effect import Signals
from models.parameter import Name
from models.surfaces.gut import Drag, drag_rate, settle, step_drag
from models.surfaces.surface import Surface

_REST = 1e-7  # m/s, below it the capsule counts as at rest for the direction of the last motion
_REST_IMPOSED = 1e-11  # m/s, the same of an imposed motion, which may creep
_STEFFENSEN = 3  # iterations for the stretch of a stiffened wall
_STRAIGHT = 1e-13  # m or m/s, below it a sequence has settled
_MOST_TURN = 0.5  # share of friction's slope that is followed where a step's speed would run away
_SMALL_DRAG = 1e-6  # m, below it the tension of a smooth model is linear in the drag


@dataclass(frozen=True)
class Grip:
    """What the surface does to the body: Coulomb part `friction` in N at the effects' `level`; of a dragged wall also
    the slip limit `onset` in N and the draw-back speed `recovery` in m/s.
    """

    friction: Any
    level: Any
    onset: Any = 0.0
    recovery: Any = 0.0


@dataclass(frozen=True)
class Stepper:
    """The parts of one model; `advance` is its step. `smoothing` in m/s makes it differentiable."""

    surface: Surface
    drive: Drive
    active: Active
    link: Link | None = None
    smoothing: float = 0.0

    def tension(self, u: Any) -> Any:
        """The wall's quasi-static tension in N, 0 where there is no wall."""
        if self.smoothing == 0 or not self.surface.dragged:
            return self.surface.tension(u)
        size = np.sqrt(u * u + _SMALL_DRAG**2)  # keeps dT/du at u = 0, where the derivatives of sign and abs are 0
        return self.surface.tension(size) * u / size

    def mucus(self, w: Any) -> Any:
        """Drag of the mucus film in N; its infinite slope at rest is cut off at `smoothing`."""
        if self.smoothing == 0 or not self.surface.dragged:
            return self.surface.mucus(w)
        size = np.sqrt(w * w + self.smoothing**2)
        return self.surface.mucus(size) * w / size

    def grip(self, s: Signals) -> Grip:
        """Friction and slip limit at `s`, with effects."""
        levels = self.active.levels(s)
        pressing = self.drive.pressing(s.x, s.command, self.active.p.base) + self.active.total("normal_load", s)
        friction, onset = self.surface.hold(np.abs(s.v), self.active.p.base, self.drive.carried_kg, levels, pressing)
        if not self.surface.dragged:
            return Grip(friction, levels[0])
        u_c = self.slipping_drag(onset, s)
        recovery = self.active.through("recovery", s, u_c / self.surface.recovery_time_s, u_c)
        return Grip(friction, levels[0], onset, recovery)

    def slipping_drag(self, onset: Any, s: Signals) -> Any:
        """`u_c` in m with `T(u_c)`, times the effects' stiffening there, equal to `onset` in N; Steffensen's steps."""
        wall = self.surface
        u = wall.drag_at(onset)
        if not any(effect.answers("stiffening") for effect in self.active.effects):
            return u
        for _ in range(_STEFFENSEN):
            once = wall.drag_at(onset / self.stiffening(s, u))
            twice = wall.drag_at(onset / self.stiffening(s, once))
            turn = twice - 2 * once + u
            bent = np.abs(turn) > _STRAIGHT
            u = np.where(bent, u - (once - u) ** 2 / np.where(bent, turn, 1.0), twice)
        return u

    def stiffening(self, s: Signals, u: Any) -> Any:
        """Factor of the effects on the tension of a wall dragged by `u` in m."""
        return self.active.product("stiffening", replace(s, drag=u))

    def wall_forces(self, s: Signals, drag: Drag, tension: Any) -> tuple[Any, Any]:
        """Tension with the effects' forces, and mucus drag, both in N against the body's motion."""
        if not self.surface.dragged:
            return 0.0, 0.0
        extra, film_speed = self.active.total("wall_force", s), np.where(drag.slip == 0, 0.0, s.v - s.drag_rate)
        return tension * self.stiffening(s, drag.u) + extra, self.mucus(film_speed)

    def drag(self, s: Signals, drag: Drag, v: Any, h: Any, grip: Grip) -> Drag:
        """The wall a step later."""
        if not self.surface.dragged:
            return drag
        return step_drag(drag, v, h, grip.onset, lambda u: self.tension(u) * self.stiffening(s, u), grip.recovery)

    def push(self, now: dict[Name, Any], s: Signals, middle: Any, h: Any) -> Push:
        """The drive's push on a free body; `middle` is the command at mid-step."""
        if self.drive.imposed:
            return Push(0.0)
        own = {name: now[self.drive.name, name] for name in self.drive.states}
        gain, p = self.active.product("gain", s), self.active.p.base
        return self.drive.push(
            Actuation(s.x, s.v, now["v"], middle, h, p, own, gain, self.active.suspension, self.active.reach)
        )

    def advance(self, now: dict[Name, Any], c0: Any, c1: Any, t: Any, h: Any) -> tuple[dict[Name, Any], Any]:
        """States a step `h` after `t` in s, command from `c0` to `c1`, and the `drive`'s force; the output then."""
        imposed = self.drive.imposed and self.link is None
        drag, rate = Drag(now["u"], now["slip"]), (c1 - c0) / h
        T_quiet = self.tension(drag.u if imposed else drag.u + 0.5 * h * now["u_rate"])
        v_now = rate if imposed else now["v"] + 0.5 * h * now["a"]
        x_now = now["x"] if imposed else now["x"] + 0.5 * h * now["v"]
        s = Signals(
            t, x_now, v_now, now["direction"], c1, rate, now["travelled"], T_quiet, drag.u, now["u_rate"], now["dwell"]
        )
        active_next = self.active.advance(s, h)
        command = active_next.passed("command", s)
        if imposed:
            v_now = (command - now["x"]) / h
        middle = command - 0.5 * h * rate
        if self.drive.launched:  # a lag changes it within the step also where the command does not
            middle = 0.5 * (self.active.passed("command", replace(s, command=c0)) + command)
        push = Push(0.0) if imposed else self.push(now, replace(s, v=v_now), middle, h)
        rest = _REST_IMPOSED if imposed else _REST
        facing = now["direction"]  # of a resting body's friction: the last motion's in a wall, else the push's
        if not self.surface.dragged:
            facing = np.where(push.force == 0, facing, np.sign(push.force))
        s = replace(s, v=v_now, command=middle, direction=np.where(np.abs(v_now) > rest, np.sign(v_now), facing))
        grip = self.grip(s)
        s = replace(s, drag_rate=drag_rate(drag, v_now, grip.recovery))
        T, F_v = self.wall_forces(s, drag, T_quiet)
        outside = self.active.total("force", s)
        if self.drive.launched:  # the mean over the step, of a load on a spring
            outside = 0.5 * (outside + active_next.total("force", s))
        if imposed:
            x_next, v_next, own = command, v_now, dict[Name, Any]()
            dragged = self.drag(s, drag, v_next, h, grip)
        else:
            v_next, v_mean = self._slowed(now, push, outside - F_v - T, s, grip, (command, rate), h)
            x_next = now["x"] + h * v_mean
            own = {(self.drive.name, name): value for name, value in push.after(v_next, v_mean).items()}
            dragged = self.drag(s, drag, v_mean, h, grip)
        s = replace(s, t=t + h, drag_rate=drag_rate(dragged, v_next, grip.recovery))
        output = x_next
        if imposed:
            T, F_v = self.wall_forces(replace(s, v=v_next), dragged, self.tension(dragged.u))
            output = grip.friction * s.direction + F_v + T - outside
        elif self.link is not None:
            output = self.link.force(command - now["x"] - h * v_next) + self.link.damping * (rate - v_next)
        new = _motion(now, x_next, v_next, dragged, s, h, rest) | own | {"drive": push.force}
        seen = replace(active_next, z=active_next.follow(s, output, h))
        return new | dict(seen.z), seen.through("measured", s, output)

    def _slowed(
        self, now: dict[Name, Any], push: Push, others: Any, s: Signals, grip: Grip, pulled: tuple[Any, Any], h: Any
    ) -> tuple[Any, Any]:
        """`_speed` under the `grip`; where its level depends on speed, by a secant at that of the step's own mean."""

        def at(friction: Any) -> tuple[Any, Any]:
            return self._speed(now, push, others, friction, pulled, h)

        found = at(grip.friction)
        if self.smoothing or not any(effect.by_speed for effect in self.active.effects):
            return found
        mean = found[1]
        facing = np.where(np.abs(mean) > _REST, np.sign(mean), s.direction)
        change = grip.friction * (self.active.levels(replace(s, v=mean, direction=facing))[0] / grip.level - 1)
        far = np.abs(mean - s.v) > _STRAIGHT
        turn = np.where(far, (at(grip.friction + change)[1] - mean) / np.where(far, mean - s.v, 1.0), 0.0)
        return at(grip.friction + change / (1 - np.minimum(turn, _MOST_TURN)))

    def _speed(
        self, now: dict[Name, Any], push: Push, others: Any, friction: Any, pulled: tuple[Any, Any], h: Any
    ) -> tuple[Any, Any]:
        """Speed of a free body at the step's end and its mean over the step, friction solved within the step."""
        m = self.surface.body_kg + push.inertia
        v = now["v"]
        free, stop = v + h / m * (push.force + others), friction * h / m
        if self.link is not None:  # solved implicitly about the stretch that the speed before would give
            command, rate = pulled
            stretch = command - now["x"] - h * v
            stiffness, damping = self.link.stiffness(stretch), self.link.damping
            mass = m + h * h * stiffness + h * damping
            free = (m * free + h * (self.link.force(stretch) + h * stiffness * v + damping * rate)) / mass
            stop = stop * m / mass
        if self.drive.turning and self.smoothing == 0:
            return turned(v, free, stop)
        v_next = settle(free, stop, self.smoothing)
        return v_next, 0.5 * (v + v_next)


def turned(v: Any, free: Any, stop: Any) -> tuple[Any, Any]:
    """Speed after a step and mean speed over it, in m/s, under constant forces and set-valued friction, with a stop
    inside the step.

    `v` before the step, `free` after it without friction, `stop` = F h/m. A body that comes to rest does so after the
    share `|v|/(stop - (free - v) sgn(v))` of the step; then it rests or slides in the other direction.
    """
    along = np.sign(v) * (free - v)
    brake = stop - along
    stops = brake > np.abs(v)
    share = np.where(stops, np.abs(v) / np.where(stops, brake, 1.0), 0.0)
    rest = 1 - share
    after = settle((free - v) * rest, stop * rest)
    v_next = np.where(stops, after, settle(free, stop))
    return v_next, np.where(stops, 0.5 * (share * v + rest * after), 0.5 * (v + v_next))


def _motion(now: dict[Name, Any], x: Any, v: Any, drag: Drag, s: Signals, h: Any, rest: float) -> dict[Name, Any]:
    """The base model's states at the step's end; a body slower than `rest` in m/s is at rest."""
    moving = np.abs(v) > rest
    return {
        "x": x,
        "v": v,
        "a": (v - now["v"]) / h,
        "u": drag.u,
        "slip": drag.slip,
        "u_rate": s.drag_rate,
        "direction": np.where(moving, np.sign(v), now["direction"]),
        "travelled": now["travelled"] + np.abs(v) * h,
        "dwell": np.where(moving, 0.0, now["dwell"] + h),
    }
