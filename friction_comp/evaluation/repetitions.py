# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""One movement of a trial: its condition and its measures."""

from __future__ import annotations

from dataclasses import dataclass, field
from datetime import datetime, timezone
import math
from pathlib import Path
import re
from typing import Any, TYPE_CHECKING

import numpy as np

from friction_comp.evaluation.ensemble import grid, LEAD
from friction_comp.evaluation.movements import measured_velocity
from friction_comp.evaluation.smoothness import log_dimensionless_jerk, spectral_arc_length

if TYPE_CHECKING:
    from friction_comp.evaluation.movements import Movement
    from friction_comp.recordings import RecordingInfo
    from friction_comp.samples import Samples

# s by which a joint may set out ahead of the movement shown.
EARLY = 0.5
# s after a joint has set out late for which its curves are still shown.
_AFTER_ONSET = 0.25
# A joint has started by itself when it covers this share of the movement while the person does
# not push that way, by this share of the torque's peak.
STARTED, _PUSHED = 0.01, 0.1
# s for which the joint must have been still before; an oscillation is no start.
_STILL = 0.2
# s by which sums of sample times may be off.
_ROUNDING = 1e-9
# Movements whose durations differ by no more than this share are of one pace: whether they are
# averaged is decided for all of a pace together. Finer classes take more memory where people move
# as they like; coarser ones blur the quarter by which a duration may differ from the usual one.
_PACE = 0.05
# Encoder steps that a joint moves when it has set out.
_LEAST_STEPS = 3
NAMES = {1: 'positive', -1: 'negative'}
# What each repetition is measured by, with its unit; the first that is known leads.
FIGURES = {
    'peak_torque': ('peak torque', 'N·m'), 'peak_time': ('time of the peak', 's'),
    'rms_torque': ('RMS torque', 'N·m'),
    'constant_velocity_torque': ('torque at constant velocity', 'N·m'),
    'residual_current': ('residual current', 'A'), 'rms_current': ('RMS current', 'A'),
    'onset': ('onset after reference', 's'),
    'announcement_to_motion': ('onset after announcement', 's'),
    'smoothness': ('smoothness (SPARC)', ''), 'log_jerk': ('log jerk', ''),
}


@dataclass(frozen=True, order=True)
class Help:
    """What was active during a movement.

    Attributes
    ----------
    law : str
        Compensation law; 'none' where no current was commanded, 'other' where another than the
        compensator commanded, 'identification' where that node did, '' where the recording does
        not say.
    model : str
        Model file; '' where there was none or the recording does not say.
    announced : int
        0 where no direction was announced, 1 where that of the movement was, -1 the other one.
    """

    law: str
    model: str
    announced: int

    @property
    def led(self) -> bool:
        """Whether a direction was announced to a law that has a use for one."""
        return self.announced != 0 and self.law not in ('none', 'kinetic')

    @property
    def words(self) -> tuple[str, str, str]:
        """Direction, law and model in a word or two each; '' for what is not known."""
        announced = {0: 'd = 0', 1: 'd = ±1', -1: 'd = ±1 (against)'}[self.announced]
        law = {'none': 'no compensation', 'other': 'another commander'}.get(self.law, self.law)
        return announced, law, Path(self.model).name

    @property
    def label(self) -> str:
        """The same in one line."""
        return ' · '.join(filter(None, self.words))

    def as_dict(self) -> dict[str, Any]:
        """Return what report.json holds."""
        return {'law': self.law or None, 'model': self.model or None, 'announced': self.announced}


@dataclass
class Repetition:
    """One movement and what was measured of it.

    Attributes
    ----------
    recording : str
    day : str
        ISO date; '' where nothing tells it.
    begin : float
        s since the recording's first joint state.
    movement : Movement
    help : Help
    figures : dict of str to float
        By the names in `FIGURES`; those that cannot be known are missing.
    moved : bool
        The joint set out; False where what was shown to the person moved and the joint did not
        before the next movement began. The peak torque then is what did not suffice.
    false_start : bool
        The joint set out during the standstill and, as far as torque was measured, unpushed.
    restless : bool
        The joint kept moving to and fro before the movement.
    curves : dict of str to ndarray
        'load', 'position' and 'reference_position', as far as recorded, at the times of
        `friction_comp.evaluation.ensemble.grid`, NaN beyond the recording and before the
        standstill; empty once they are summed up.
    """

    recording: str
    day: str
    begin: float
    movement: Movement
    help: Help
    figures: dict[str, float]
    moved: bool
    false_start: bool
    restless: bool
    curves: dict[str, np.ndarray] = field(default_factory=dict)

    @property
    def duration(self) -> float:
        """Time in s from begin to end of the movement."""
        return self.movement.end - self.movement.begin

    @property
    def shown_time(self) -> float:
        """Time in s from the movement's begin until it is over and the joint has set out."""
        return max(self.duration, self.figures.get('onset', -math.inf) + _AFTER_ONSET)

    @property
    def pace(self) -> int:
        """Which durations it is alike to."""
        return round(math.log(self.duration) / _PACE)

    @property
    def usual_duration(self) -> float:
        """Duration in s in the middle of its pace."""
        return math.exp(_PACE * self.pace)

    @property
    def kind(self) -> tuple[Help, int, int, int]:
        """The key of movements whose curves are averaged together."""
        return self.help, self.movement.sign, self.movement.direction, self.pace


def measure(samples: Samples, movement: Movement, name: str = '',
            info: RecordingInfo | None = None,
            residual: np.ndarray | None = None) -> Repetition:
    """Measure one movement.

    Parameters
    ----------
    samples : Samples
        The recording that it is in.
    movement : Movement
    name : str
        The recording's name.
    info : RecordingInfo, optional
        Says what was active, and when it was recorded.
    residual : ndarray, optional
        Current in A that the joint asks for by a model beyond what was commanded, shape (N,).

    Returns
    -------
    Repetition
    """
    part = _between(samples, movement.begin, movement.end)
    shown = samples.reference_position is not None or samples.reference_velocity is not None
    onset = _onset(samples, movement) if shown else None
    figures = {'rms_current': _rms(samples.current[part])}
    if samples.load is not None:
        figures.update(_torque_figures(samples, samples.load, movement, onset, shown))
    if residual is not None:
        figures['residual_current'] = _rms(residual[part])
    if onset is not None:
        figures['onset'] = onset - movement.begin
        announced = _announcement(samples, movement)
        if announced is not None and onset > announced:
            figures['announcement_to_motion'] = onset - announced
    moved = onset is not None or not shown
    # A joint that set out after the movement shown made another one, of which this says nothing.
    if moved and (onset is None or onset <= movement.end) and part.stop - part.start > 10:
        velocity = measured_velocity(samples.take(part))
        figures['smoothness'] = spectral_arc_length(velocity, samples.sample_time)
        jerk = log_dimensionless_jerk(velocity, samples.sample_time)
        if np.isfinite(jerk):
            figures['log_jerk'] = jerk
    repetition = Repetition(
        name, _day(info, movement), movement.begin, movement,
        _help(samples, movement, info, moved),
        {key: value for key, value in figures.items() if np.isfinite(value)},
        moved, _started_by_itself(samples, movement, figures.get('peak_torque')),
        _restless(samples, movement))
    repetition.curves = _curves(samples, movement, repetition.shown_time)
    return repetition


def _between(samples: Samples, begin: float, end: float) -> slice:
    first, last = np.searchsorted(samples.time, [begin, end])
    return slice(int(first), max(int(last), int(first) + 1))


def _rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(values ** 2)))


def effort(time: np.ndarray, load: np.ndarray, movement: Movement, onset: float | None,
           shown: bool) -> np.ndarray:
    """Return what of the torque counts for a movement's peak: what it took to move the joint.

    It counts from the movement's begin until it slows down, or until the joint sets out where that
    comes later. What is before the begin is left from the movement before, unless the joint set
    out early; where no movement was shown, the begin is that of the joint itself, and what set it
    in motion comes before. Until the joint sets out only a push along the movement counts, and
    afterwards also what holds it back.

    Parameters
    ----------
    time : ndarray, shape (N,)
        s on the clock of `movement`.
    load : ndarray, shape (N,)
        τ_b in N·m.
    movement : Movement
    onset : float or None
        When the joint set out, s; None if it did not, or no movement was shown.
    shown : bool
        Whether a reference says when the movement was to begin.

    Returns
    -------
    ndarray, shape (N,)
        N·m; -1 where nothing counts.
    """
    first, last = movement.begin, movement.constant_end
    if shown and onset is None:
        set_out, last = np.inf, movement.end
    else:
        set_out = movement.begin if onset is None else onset
        last = max(last, set_out)
        if not shown or set_out < first:
            first = max(first - EARLY, movement.rest_begin)
    given = np.where(time >= set_out, np.abs(load), np.maximum(movement.sign * load, 0.0))
    counted = (time >= first - _ROUNDING) & (time <= last + _ROUNDING) & np.isfinite(load)
    return np.where(counted, given, -1.0)


def _torque_figures(samples: Samples, load: np.ndarray, movement: Movement,
                    onset: float | None, shown: bool) -> dict[str, float]:
    whole = _between(samples, movement.begin - EARLY, movement.rest_end)
    given = effort(samples.time[whole], load[whole], movement, onset, shown)
    peak = int(np.argmax(given))
    constant = _between(samples, movement.constant_begin, movement.constant_end)
    return {
        'peak_torque': float(given[peak]),
        'peak_time': float(samples.time[whole.start + peak] - movement.begin),
        'rms_torque': _rms(load[_between(samples, movement.begin, movement.end)]),
        'constant_velocity_torque': float(movement.sign * np.mean(load[constant]))}


def _onset(samples: Samples, movement: Movement) -> float | None:
    """Return when the joint set out, s; None if it did not before the next movement began."""
    part = _between(
        samples, max(movement.begin - EARLY, movement.rest_begin), movement.rest_end)
    way = movement.sign * (samples.position[part] - samples.position[part.start])
    gone = np.nonzero(way > max(
        STARTED * movement.travel, _LEAST_STEPS * samples.position_step))[0]
    return float(samples.time[part.start + gone[0]]) if len(gone) else None


def _announcement(samples: Samples, movement: Movement) -> float | None:
    """Return when the movement's direction was announced, s; None if it was not."""
    if samples.direction is None or movement.direction != movement.sign:
        return None
    last = int(np.searchsorted(samples.time, movement.constant_begin))
    others = np.nonzero(samples.direction[:last] != movement.sign)[0]
    return float(samples.time[others[-1] + 1]) if len(others) and others[-1] + 1 < last else None


def _help(samples: Samples, movement: Movement, info: RecordingInfo | None,
          moved: bool) -> Help:
    announced = 0 if movement.direction == 0 else (
        1 if movement.direction == movement.sign else -1)
    law, model, active = '', (info.model or '') if info else '', True
    known = [activity for since, activity in (info.activity if info else [])
             if since <= movement.constant_end]
    if known:
        if known[-1].state == 'identification':
            return Help('identification', '', announced)
        active = known[-1].state in ('', 'active')
        law, model = known[-1].law, known[-1].model or model
    if samples.command is not None:
        idle = not samples.command[_between(samples, movement.begin, movement.end)].any()
        # A law may well leave a joint alone that stands still.
        if (idle and (moved or not law)) or not active:
            law = 'none' if idle else 'other'
    elif not active:
        law = 'none'
    # Without a law no model has any part in it, whichever was loaded.
    return Help(law, '' if law in ('none', 'other') else model, announced)


def _day(info: RecordingInfo | None, movement: Movement) -> str:
    """Return the date by the stamps or, where these are a simulation's, by the name; '' without."""
    if info is None:
        return ''
    moment = info.start + movement.begin
    # Stamps before 2000 count from the start of something else than the calendar.
    if moment > 946_684_800:
        return datetime.fromtimestamp(moment, timezone.utc).date().isoformat()
    dated = re.search(r'(20\d\d)[-_.]?([01]\d)[-_.]?([0-3]\d)', str(info.path))
    if dated:
        try:
            return datetime(*map(int, dated.groups())).date().isoformat()  # type: ignore[arg-type]
        except ValueError:
            return ''
    return ''


def _curves(samples: Samples, movement: Movement, shown_time: float) -> dict[str, np.ndarray]:
    at = movement.begin + grid(shown_time)
    curves = {}
    for name in ('load', 'position', 'reference_position'):
        values = getattr(samples, name)
        if values is not None:
            curve = np.interp(at, samples.time, values, left=np.nan, right=np.nan)
            curves[name] = np.where(at >= movement.rest_begin, curve, np.nan)
    return curves


def _restless(samples: Samples, movement: Movement) -> bool:
    """Return whether the joint kept moving to and fro right before the movement."""
    first, last = np.searchsorted(
        samples.time, [max(movement.begin - EARLY, movement.rest_begin), movement.begin])
    travelled = np.abs(np.diff(samples.position[first:last])).sum()
    return bool(travelled > 2.0 * STARTED * movement.travel)


def _started_by_itself(samples: Samples, movement: Movement, peak: float | None) -> bool:
    """Return whether the joint set out during the standstill although nobody pushed it."""
    settled = 0.5 * (movement.rest_begin + movement.begin)
    begin = max(settled, movement.begin - LEAD)
    first, last = np.searchsorted(samples.time, [begin, movement.begin])
    still = np.searchsorted(samples.time, begin + _STILL)
    if not first < still < last:
        return False
    way = samples.position[first:last] - samples.position[first]
    if np.abs(way[:still - first]).max() > 0.2 * STARTED * movement.travel:
        return False
    gone = np.nonzero(np.abs(way) > STARTED * movement.travel)[0]
    if not len(gone):
        return False
    if samples.load is None or peak is None:
        return True
    onset = first + gone[0]
    before = np.searchsorted(samples.time, samples.time[onset] - 0.1)
    push = np.mean(samples.load[before:onset + 1]) * np.sign(way[gone[0]])
    return bool(push < _PUSHED * peak)
