# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Rejects measured values that no joint can have, and signals that contradict each other.

Results from such recordings would look valid. The limits are far beyond any geared drive: they
reject corrupt files, wrong units and wrong signs, but not unusual machines.
"""

from __future__ import annotations

import math

import numpy as np

from friction_comp import signal_checks
from friction_comp.errors import InputError
from friction_comp.samples import Samples

# Largest ratio of velocity to rate of position, or its inverse; a wrong unit gives 57 or more.
_LARGEST_RATIO = 3.0
# Share of the blocks of motion in which velocity must contradict position, and fewest blocks. In 26
# recorded joints this share is at most 0.02; with velocity in deg/s or reversed, at least 0.57.
_CONTRADICTING, _FEWEST_BLOCKS = 0.5, 30
# Correlation of measured and commanded current below which their signs are opposite.
_OPPOSED = -0.9
# Fewest samples of each direction in a bin of position, and the share of the motion in which the
# effort must appear reversed.
_PER_BIN, _REVERSED_SHARE = 10, 0.8
# Difference between the directions, of the usual effort, that counts as none, and the share of the
# motion in which an effort without a sign must show none.
_NO_DIFFERENCE, _UNSIGNED_SHARE = 0.02, 0.2
# Fewest samples near zero with which an effort comes down to it.
_FEWEST_LOW = 5
# Fewest samples of each sign, as a share, where the sign is a bit of the number; the least bit, in
# steps; steps above zero and above the bit within which amounts begin; and of the empty gap below.
_OF_EACH_SIGN, _LEAST_BIT, _BEGINS, _GAP = 0.05, 64.0, 8.0, 10.0


def check_plausible(samples: Samples, name: str, alone: bool = True) -> None:
    """Raise InputError for samples that are physically impossible.

    `alone` says that no other joint of the recording moved: then the gravity torque depends on the
    position alone, and the motor's mean power must be positive.
    """
    if not len(samples):
        return
    for check in (_fault_of_limits, _fault_of_rate, _fault_of_velocity, _fault_of_command,
                  _fault_of_sign_bit, _fault_of_sign, *([_fault_of_power] if alone else [])):
        fault = check(samples)
        if fault:
            joint = f'joint {samples.joint!r}: ' if samples.joint else ''
            raise InputError(f'{name}: {joint}{fault}')


def _fault_of_limits(samples: Samples) -> str:
    for signal, (limit, unit) in signal_checks.LIMITS.items():
        values = getattr(samples, signal)
        if values is not None and (impossible := signal_checks.beyond(signal, values)).any():
            worst = int(np.argmax(np.where(impossible, np.abs(values), 0.0)))
            return (f'{signal.replace("_", " ")} of {values[worst]:.4g} {unit} at '
                    f'{samples.time[worst]:.3f} s is impossible ({np.count_nonzero(impossible)} '
                    f'of {len(values)} values beyond {limit:.0e} {unit})')
    return ''


def _fault_of_rate(samples: Samples) -> str:
    step = np.diff(samples.time)
    with np.errstate(divide='ignore', invalid='ignore'):
        rate = np.abs(np.where(step > 0, np.diff(samples.position) / step, 0.0))
    if not signal_checks.beyond('velocity', rate).any():
        return ''
    worst = int(np.argmax(rate))
    return (f'position jumps from {samples.position[worst]:.4g} to '
            f'{samples.position[worst + 1]:.4g} rad within {step[worst]:.3g} s at '
            f'{samples.time[worst]:.3f} s, which is impossible (wrong unit of position or of '
            'the stamps?)')


def _fault_of_velocity(samples: Samples) -> str:
    velocity = samples.velocity
    # Some drivers publish zeros where they measure no velocity.
    if velocity is None or not velocity.any():
        return ''
    ratios = signal_checks.velocity_ratios(samples.time, samples.position, velocity)
    ratios = ratios[np.isfinite(ratios)]
    contradict = (ratios <= 1.0 / _LARGEST_RATIO) | (ratios >= _LARGEST_RATIO)
    if len(ratios) >= _FEWEST_BLOCKS and contradict.mean() > _CONTRADICTING:
        # Where ratios scatter to both sides, no factor is wrong.
        if fault := signal_checks.velocity_fault(ratios, _LARGEST_RATIO):
            return fault + (' (--unit says it, such as velocity=deg/s, velocity=turn/s '
                            'or position=turn)')
    return ''


def _fault_of_command(samples: Samples) -> str:
    command, current = samples.command, samples.current
    if (command is not None and len(samples) >= 200 and command.any() and current.any()
            and signal_checks.current_answer(command, current)[1] < _OPPOSED):
        return ('effort and commanded current have opposite signs: one of them has the '
                'wrong sign')
    return ''


def _fault_of_sign_bit(samples: Samples) -> str:
    """Return the fault of an effort whose sign is a bit of its number, as in registers of servos.

    Amounts of one sign begin at zero, those of the other at a power of two, in steps of the
    register, and nothing lies between.
    """
    levels = np.unique(samples.current)
    if len(levels) < 3 or levels[0] < 0.0:
        return ''
    gaps = np.diff(levels)
    # The median, since in single precision steps differ.
    step = float(np.median(gaps[gaps < 1.5 * gaps.min()]))
    low, high = levels[int(np.argmax(gaps)):][:2]
    bit = 2.0 ** math.floor(math.log2(high / step + 0.5))
    upper = float(np.mean(samples.current > low))
    if (levels[0] > _BEGINS * step or high / step - bit > _BEGINS or high - low < _GAP * step
            or not low / step < bit >= _LEAST_BIT or min(upper, 1.0 - upper) < _OF_EACH_SIGN):
        return ''
    return (f'effort is never negative, and jumps between 0 and {bit:g} of its steps: the sign is '
            f'a bit of the number, as in registers of servos. From values of {bit * step:.4g} or '
            'more subtract this, and give either these or the others a minus')


def _fault_of_sign(samples: Samples) -> str:
    """Return the fault of an effort without a sign, as some drives report their current.

    In both directions it comes down to zero and never below, and it is no larger in the positive
    direction: friction and weight that are always on one side leave a difference.
    """
    current, bins = samples.current, _by_position(samples)
    if samples.load is not None or bins is None or current.min() < 0.0:
        return ''
    mean, _, weight = bins
    usual = float(np.quantile(current, 0.95))
    low = float(weight[mean[:, 1] - mean[:, 0] < _NO_DIFFERENCE * usual].sum())
    if low < _UNSIGNED_SHARE or np.count_nonzero(current < 0.05 * usual) < _FEWEST_LOW:
        return ''
    return ('effort is never negative, and no larger in one direction than in the other: it is an '
            'amount without a sign, which does not show friction; record it with its sign')


def _fault_of_power(samples: Samples) -> str:
    """Return the fault of an effort with reversed sign.

    At a given position, friction must make the effort larger in the positive direction. With a
    command or a load the motor may have been braking or driven: then this is not checked.
    """
    if samples.load is not None or (samples.command is not None and samples.command.any()):
        return ''
    bins = _by_position(samples)
    if bins is None:
        return ''
    mean, variance, weight = bins
    difference = mean[:, 1] - mean[:, 0]
    # A difference within the scatter of single samples may be that of another load.
    scatter = np.sqrt(max(float(weight @ variance.mean(axis=1)), 0.0))
    if weight @ difference < -scatter and weight[difference < 0].sum() > _REVERSED_SHARE:
        # Whether these are A or N·m is not known here.
        return ('the motor brakes the motion: effort has the wrong sign (--unit effort=-1Nm or '
                'current=-1A reverses it), or another torque drives the joint and neither '
                'current_command nor interaction_wrench is recorded')
    return ''


def _by_position(samples: Samples) -> tuple[np.ndarray, np.ndarray, np.ndarray] | None:
    velocity = samples.velocity if samples.velocity is not None else _rate(samples)
    return signal_checks.by_position(samples.position, velocity, samples.current, _PER_BIN)


def _rate(samples: Samples) -> np.ndarray:
    """Return the rate of position over 20 ms, shape (N,)."""
    half = max(round(0.01 / max(samples.sample_time, 1e-6)), 1)
    index = np.arange(len(samples))
    later, earlier = np.minimum(index + half, len(index) - 1), np.maximum(index - half, 0)
    step = samples.time[later] - samples.time[earlier]
    return np.divide(samples.position[later] - samples.position[earlier], step,
                     out=np.zeros(len(index)), where=step > 0)
