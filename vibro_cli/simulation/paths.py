"""The flights of a run as whole paths: start, end, and what they pass in between."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from vibro_cli.mechanics.flow import LINE, POLYNOMIAL, acceleration_at, flow
from vibro_cli.mechanics.heights import heights
from vibro_cli.mechanics.passage import time_to
from vibro_cli.mechanics.records import NEVER, Flight
from vibro_cli.mechanics.trace import sine_cosine
from vibro_cli.mechanics.turning_flight import potential_head, set_track
from vibro_cli.numerics.elliptic import quarter_period, set_theta_constants
from vibro_cli.numerics.quartic import period_of
from vibro_cli.simulation.geometry import Floats, Places
from vibro_cli.simulation.prepare import turning_tracks
from vibro_cli.simulation.turning import kernel_of
from vibro_cli.simulation.turning_groups import recall_group_motion
from vibro_cli.simulation.world import CAUSE_NAMES

_GROUP_FIELDS = (
    "flow_s", "flow_c", "flow_p", "shift_s", "shift_c", "rate_ratio", "frequency",
    "line_acceleration", "segment",
)  # fmt: skip


class Paths:
    """All flights of a run, body by body in order of time, each with its end.

    Parameters
    ----------
    places
        Geometry of the system.
    log
        Rows of ``FlightRow``.
    segments
        Rows of ``SegmentRow``.
    end_t, end_t_low
        The instant at which the run ended (two doubles, s).
    """

    def __init__(
        self, places: Places, log: Any, segments: Any, end_t: float, end_t_low: float
    ) -> None:
        self.places = places
        self._flow = kernel_of(places.system, flow)
        self._time_to = kernel_of(places.system, time_to)
        self._acceleration = kernel_of(places.system, acceleration_at)
        self.tracks = turning_tracks(places.system)
        order = np.lexsort((np.arange(len(log)), log["body"]))
        self.log = log[order]
        self._number = order
        self._series = {int(row["flight"]): row["series"].tolist() for row in segments}
        self.body = self.log["body"]
        self.piece = self.log["piece"]
        last = np.append(self.body[1:] != self.body[:-1], True)
        self.last = last
        following = np.minimum(np.arange(len(self.log)) + 1, len(self.log) - 1)
        nxt = self.log[following]
        self.t_end = np.where(last, end_t, nxt["t"])
        self.t_end_low = np.where(last, end_t_low, nxt["t_low"])
        self.duration = (self.t_end - self.log["t"]) + (self.t_end_low - self.log["t_low"])
        self.end_s = np.where(last, 0.0, nxt["before_s"])
        self.end_c = np.where(last, 0.0, nxt["before_c"])
        self.end_p = np.where(last, 0.0, nxt["before_p"])
        self.end_cause = np.where(last, -1, nxt["cause"])
        for index in np.flatnonzero(last):
            state = self.state(self.flight(int(index)), float(self.duration[index]))
            self.end_s[index], self.end_c[index], self.end_p[index] = state

    def state(self, flight: Flight, t: float) -> tuple[float, float, float]:
        """Return ``(S, C, P)`` a time (s) after the start of a flight."""
        return self._flow(flight, t)

    def acceleration(self, index: int, flight: Flight, t: float) -> float:
        """Return the acceleration of a body along its path (m/s^2) at a time (s) of its flight."""
        s, c, _ = self._flow(flight, t)
        rho = float(self.places.path_radius[self.body[index], self.piece[index]])
        return self._acceleration(flight, rho, t, s, c)

    def flight(self, index: int) -> Flight:
        """Return one flight as the record that the kernels take."""
        row = self.log[index]
        piece = self.places.system.trace.pieces[row["piece"]]
        flight = Flight()
        flight.piece = int(row["piece"])
        flight.lap = int(row["lap"])
        flight.s, flight.c, flight.p = float(row["s"]), float(row["c"]), float(row["p"])
        flight.flow_s, flight.flow_c, flight.flow_p = flight.s, flight.c, flight.p
        flight.own_frequency = float(self.places.frequencies[row["body"], row["piece"]])
        flight.frequency = flight.own_frequency
        flight.at_rest = int(row["at_rest"])
        if row["grouped"]:
            self._complete_group(flight, row, index)
        elif self.tracks is not None:
            set_track(flight, self.tracks[row["body"]][row["piece"]])
        if self.tracks is not None:
            return flight
        if piece.is_line and flight.form != POLYNOMIAL:
            flight.form = LINE
            if not flight.grouped:
                body = self.places.system.bodies[row["body"]]
                rate = self.places.gravity / body.kappa
                flight.line_acceleration = -rate * sine_cosine(piece.start_slope)[0]
            return flight
        if flight.form == POLYNOMIAL:
            return flight
        set_theta_constants(flight, float(row["parameter"]), float(row["root_complement"]))
        return flight

    def _complete_group(self, flight: Flight, row: Any, index: int) -> None:
        """Fill in what a flight in lasting contact has beyond its own state."""
        flight.grouped = 1
        for name in _GROUP_FIELDS:
            setattr(flight, name, float(row[name]))
        series = self._series.get(int(self._number[index]))
        if series is not None:
            flight.series = series
            if flight.segment == NEVER:
                assert self.tracks is not None
                recall_group_motion(flight, self.tracks[row["body"]][row["piece"]])
                return
            flight.form = POLYNOMIAL
            rho = float(self.places.path_radius[row["body"], row["piece"]])
            flight.half_curvature = 0.5 / rho if rho > 0.0 else 0.0

    def table(self) -> dict[str, Any]:
        """Return the flights as columns: body, arc, times, positions and rates at both ends."""
        causes = np.array([*CAUSE_NAMES, "end"], dtype=object)
        return {
            "ball": self.body + 1,
            "arc": self.piece + 1,
            "t_start": self.log["t"].copy(),
            "t_end": self.t_end.copy(),
            "angle_start": self.places.position(self.piece, self.log["s"], self.log["c"]),
            "rate_start": self._rate(self.log["p"]),
            "angle_end": self.places.position(self.piece, self.end_s, self.end_c),
            "rate_end": self._rate(self.end_p),
            "contact": self.log["grouped"] == 1,
            "cause_start": causes[self.log["cause"]],
            "cause_end": causes[self.end_cause],
        }

    def _rate(self, p: Floats) -> Floats:
        """Rate of the angle (rad/s) from ``P``; on a line the speed (m/s)."""
        frequency = self.places.frequency(self.body, self.piece)
        return np.where(frequency > 0.0, 2.0 * frequency * p, p)

    def half_period(self, index: int) -> float:
        """Half the period (s) of a flight's full orbit on its arc (infinite on a separatrix)."""
        if self.tracks is not None:
            flight = self.flight(index)
            return 0.5 * period_of(flight) / flight.frequency
        row = self.log[index]
        argument = 2.0 * quarter_period(float(row["parameter"]), float(row["root_complement"]))
        grouped = bool(row["grouped"])
        own = self.places.frequencies[row["body"], row["piece"]]
        return argument / float(row["frequency"] if grouped else own)

    def rotates(self, flight: Flight) -> bool:
        """Tell whether the full orbit of a flight on an arc goes over its highest place."""
        if self.tracks is not None:
            return flight.turns_over == 1
        return flight.root_complement < 0.0

    def passages(self, index: int, s: float, c: float, p: float) -> list[float]:
        """Times (s from the flight's start) at which it passes a state of its orbit on an arc.

        ``(s, c, p)`` must lie on the orbit; every passage within the flight is returned, in order.
        """
        flight = self.flight(index)
        duration = float(self.duration[index])
        if flight.at_rest or flight.root_complement == 0.0 or flight.form == POLYNOMIAL:
            return []
        first = self._time_to(flight, s, c, p)
        if self.rotates(flight):
            # A rotation passes a place once on its piece, ahead only.
            ahead = math.atan2(s, c) - math.atan2(flight.flow_s, flight.flow_c)
            ahead *= flight.flow_p
            return [first] if ahead > 0.0 and first <= duration else []
        period = 2.0 * self.half_period(index)
        times = []
        while first <= duration:
            if first > 0.0:
                times.append(first)
            first += period
        return times

    def curve(self, index: int, count: int) -> tuple[Floats, Floats, Floats]:
        """Return times, positions and rates at ``count`` points along one flight, exactly."""
        flight = self.flight(index)
        start = float(self.log["t"][index])
        after = np.linspace(0.0, float(self.duration[index]), count)
        states = np.array([self.state(flight, float(t)) for t in after])
        piece = np.full(count, self.piece[index])
        position = self.places.position(piece, states[:, 0], states[:, 1])
        frequency = flight.own_frequency
        rate = states[:, 2] * (2.0 * frequency if frequency > 0.0 else 1.0)
        return start + after, position, rate

    def sample(self, times: Any, side: str = "after") -> dict[str, Any]:
        """Return the motion of every body at given times (see ``simulation.run.Run.sample``)."""
        if side not in ("after", "before"):
            raise ValueError(f"side must be 'after' or 'before', not {side!r}")
        times = np.atleast_1d(np.asarray(times, dtype=np.float64))
        bodies = len(self.places.system.bodies)
        chosen = np.empty((len(times), bodies), dtype=np.int64)
        for body in range(bodies):
            rows = np.flatnonzero(self.body == body)
            starts = self.log["t"][rows]
            where = np.searchsorted(starts, times, side="right" if side == "after" else "left")
            chosen[:, body] = rows[np.maximum(where - 1, 0)]
        return self._states(np.repeat(times, bodies), chosen.ravel())

    def _states(self, times: Floats, chosen: Any) -> dict[str, Any]:
        ages = (times - self.log["t"][chosen]) - self.log["t_low"][chosen]
        states = np.empty((len(times), 3))
        flights: dict[int, Flight] = {}
        for number, index in enumerate(chosen.tolist()):
            if index not in flights:
                flights[index] = self.flight(index)
            states[number] = self.state(flights[index], max(float(ages[number]), 0.0))
        body, piece = self.body[chosen], self.piece[chosen]
        s, c, p = states.T
        position = self.places.position(piece, s, c)
        x, y = self.places.centre(body, piece, s, c)
        return {
            "t": times,
            "ball": body + 1,
            "arc": piece + 1,
            "angle": self.places.angle(piece, s, c),
            "s": self.places.arc_length(piece, position),
            "x": x,
            "y": y,
            "speed": self.places.speed_factor(body, piece) * p,
            "energy": self._energy(chosen, s, c, p),
        }

    def _energy(self, chosen: Any, s: Floats, c: Floats, p: Floats) -> Floats:
        """Energy (J); carried on a free flight, from the state in lasting contact."""
        body, piece = self.body[chosen], self.piece[chosen]
        head = self.log["head"][chosen].copy()
        grouped = self.log["grouped"][chosen] == 1
        level = np.array(
            [[h.bottom for h in heights(self.places.system.trace, b.radius)]
             for b in self.places.system.bodies]
        )  # fmt: skip
        rise = np.array([sine_cosine(q.start_slope)[0] for q in self.places.system.trace.pieces])
        rho = self.places.path_radius[body, piece]
        speed = self.places.speed_factor(body, piece) * p
        height = level[body, piece] + np.where(rho > 0.0, 2.0 * rho * s * s, rise[piece] * s)
        if self.tracks is not None:
            height = self._turning_height(body, piece, s, c)
        own = height + 0.5 * self.places.kappa[body] * speed * speed / self.places.gravity
        energy: Floats = self.places.weight[body] * np.where(grouped, own, head)
        return energy

    def _turning_height(self, body: Any, piece: Any, s: Floats, c: Floats) -> Floats:
        """Height (m) whose potential energy is that of gravity and of a turning trace."""
        assert self.tracks is not None
        kappa, gravity = self.places.kappa, self.places.gravity
        rows = zip(body.tolist(), piece.tolist(), s.tolist(), c.tolist(), strict=True)
        return np.array(
            [potential_head(self.tracks[b][q], gravity, kappa[b], x, y) for b, q, x, y in rows]
        )
