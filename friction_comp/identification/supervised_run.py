# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Runs a motion sample by sample under its supervision, and ends it with zero current."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Generator
import math

from friction_comp.drive import Drive
from friction_comp.identification.goal import IdentificationError
from friction_comp.identification.kinetic import Sample
from friction_comp.identification.supervision import Arrivals, LONGEST_GAP, Supervision


class SupervisedRun(ABC):
    """One run of a motion, from standstill to zero current.

    Call `update` with every sample and apply the current that it returns, until `finished`. The
    motion is a generator that yields currents in A and receives samples.
    """

    # Largest friction current known so far in the positive and negative direction, signed, A.
    friction: tuple[float, float] | None = None
    acceleration = math.nan     # k_t·n/J, rad/s² per A; NaN before it is known

    def __init__(self, drive: Drive, supervision: Supervision) -> None:
        self.drive, self.supervision = drive, supervision
        self.error = ''             # why the run failed; empty if it did not
        self.finished = False       # whether the run is complete
        self.phase = 'standstill'   # present step of the run; 'done' or 'failed' after it
        self.progress = 0.0         # 0 to 1, never falling
        self.remaining = math.nan   # estimated time to the end, s
        self._run = self._motion()
        next(self._run)
        self._begin: float | None = None
        self._last: float | None = None
        self._estimated, self._command = -math.inf, 0.0

    @property
    def arrivals(self) -> Arrivals:
        """When samples arrive; whoever drives a real joint adds each before `update`."""
        return self.supervision.arrivals

    @abstractmethod
    def _motion(self) -> Generator[float, Sample, None]:
        """Yield currents in A and receive samples, from rest to rest."""

    @abstractmethod
    def _bounds(self) -> tuple[float, float]:
        """Return the lowest and highest position in rad that the joint may have."""

    @abstractmethod
    def _time_left(self) -> float:
        """Return the estimated time to the end in s."""

    def update(self, time: float, position: float, velocity: float | None = None,
               current: float = 0.0) -> float:
        """Take one sample of the joint and return the current to apply, A; zero when finished.

        Parameters
        ----------
        time : float
            s, on any time base; a sample that is not newer than the last one changes nothing.
        position : float
            rad.
        velocity : float, optional
            rad/s; only compared with the change of position, which is more precise.
        current : float
            Measured motor current in A.

        Raises
        ------
        IdentificationError
            If the joint leaves its range, the encoder fails, or the drive does not respond as
            expected. From then on every call returns zero.
        """
        if self.finished or self.error:
            return 0.0
        try:
            self._check(time, position)
            if self._last is not None and time <= self._last:
                return self._command
            self.supervision.check(
                float(time), float(position), velocity, float(current), self._command,
                self.friction, self.acceleration)
            command = self._run.send(Sample(
                float(time), float(position),
                float(current) if math.isfinite(current) else math.nan))
        except StopIteration:
            self.finished, self.phase = True, 'done'
            self.progress, self.remaining, self._command = 1.0, 0.0, 0.0
            return 0.0
        except Exception as error:
            self.abort(str(error))
            raise
        self._last = float(time)
        self._estimate(self._last)
        limit = self.drive.current_limit
        self._command = min(max(command, -limit), limit)
        return self._command

    def abort(self, reason: str = 'cancelled') -> None:
        """End the run: every later `update` returns zero current."""
        if not self.finished:
            self.error, self._command, self.remaining = reason or 'cancelled', 0.0, 0.0
            self.phase = 'failed'
            self._run.close()

    def _check(self, time: float, position: float) -> None:
        if not math.isfinite(time):
            raise IdentificationError('the time of a sample is not finite')
        if not math.isfinite(position):
            raise IdentificationError('the joint position is not finite: encoder failure')
        if self._last is None:
            return
        if abs(time - self._last) > LONGEST_GAP:
            what = 'no sample for' if time > self._last else 'time went back by'
            raise IdentificationError(
                f'{what} {abs(time - self._last):.2g} s; the limit is {LONGEST_GAP} s')
        low, high = self._bounds()
        if not low <= position <= high:
            raise IdentificationError(f'the joint left its motion range of {high - low:.4g} rad')

    def _estimate(self, now: float) -> None:
        """Update `remaining` and `progress` ten times per second of the joint's time."""
        if self._begin is None:
            self._begin = now
        elif now - self._estimated < 0.1:
            return
        self._estimated = now
        elapsed = now - self._begin
        self.remaining = self._time_left()
        share = elapsed / max(elapsed + self.remaining, 1e-9)
        self.progress = max(self.progress, min(0.999, share))
