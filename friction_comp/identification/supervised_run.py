# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Runs a script that moves a joint, sample by sample, and releases it at the first fault.

One principle: **zero current whenever the joint does not do what a joint does**. A script says what
to command, the supervision what must be measured then; a sample that comes too late, a place
outside the range or a fault of the drive ends the run for good.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from friction_comp.identification.goal import IdentificationError
from friction_comp.identification.ramp import Sample

if TYPE_CHECKING:
    from friction_comp.identification.motion import Motion

LONGEST_GAP = 0.25      # s without a sample after which the joint is out of control


class SupervisedRun:
    """One run of a script, from standstill to zero current.

    Call `update` with every sample and apply the current that it returns, until `finished`.

    Parameters
    ----------
    script : Motion

    Attributes
    ----------
    progress : float
        0 to 1, never falling.
    remaining : float
        Estimated time to the end in s.
    finished : bool
        Whether all was done.
    error : str
        Why the run failed; empty while it has not.
    """

    def __init__(self, script: Motion) -> None:
        self.drive = script.drive
        self.error, self.finished = '', False
        self.progress, self.remaining = 0.0, math.nan
        self._script: Motion = script
        self._run = script.run()
        next(self._run)
        self._begin: float | None = None
        self._last: float | None = None
        self._estimated, self._command = -math.inf, 0.0

    @property
    def phase(self) -> str:
        """The run's present step."""
        if self.error:
            return 'failed'
        return 'done' if self.finished else self._script.phase

    def update(self, time: float, position: float, velocity: float | None = None,
               current: float = 0.0) -> float:
        """Take one sample of the joint and return the current to apply.

        Parameters
        ----------
        time : float
            s, on any time base; a sample that is not newer than the last one changes nothing.
        position : float
            rad.
        velocity : float, optional
            rad/s. The position must go where it leads; for all else the position is finer.
        current : float
            Measured motor current in A.

        Returns
        -------
        float
            A; zero when finished.

        Raises
        ------
        IdentificationError
            When the joint leaves its range, the encoder fails, or the drive does not answer as a
            drive does. From then on every call returns zero.
        """
        if self.finished or self.error:
            return 0.0
        try:
            self._check(time, position)
            if self._last is not None and time <= self._last:
                return self._command
            self._script.supervision.check(
                float(time), float(position), velocity, float(current), self._command,
                self._script.friction, self._script.acceleration)
            command = self._run.send(Sample(
                float(time), float(position),
                float(current) if math.isfinite(current) else math.nan))
        except StopIteration:
            self.finished = True
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
                f'{what} {abs(time - self._last):.2g} s; {LONGEST_GAP} s are tolerated')
        low, high = self._script.bounds()
        if not low <= position <= high:
            raise IdentificationError(
                f'the joint left its motion range of {high - low:.4g} rad')

    def _estimate(self, now: float) -> None:
        """Renew `remaining` and `progress`, ten times a second of the joint's time."""
        if self._begin is None:
            self._begin = now
        elif now - self._estimated < 0.1:
            return
        self._estimated = now
        elapsed = now - self._begin
        self.remaining = self._script.remaining()
        share = elapsed / max(elapsed + self.remaining, 1e-9)
        self.progress = max(self.progress, min(0.999, share))
