# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Delay between the current and the torque it makes."""

from __future__ import annotations

from collections.abc import Sequence
import math
from typing import Any, TYPE_CHECKING

import numpy as np

from friction_comp.errors import InputError
from friction_comp.model.differentiation import advance, delayed, earlier
from friction_comp.model.effects.base import Effect
from friction_comp.model.effects.scene import NEITHER, Search, too_coarse

if TYPE_CHECKING:
    from friction_comp.model.effects.scene import Scene, Signals
    from friction_comp.samples import Samples

# The longest lag tried, s.
_LONGEST = 0.15
# Share of the loss that a lag has to take away. A sample or two may be how the signals were
# sampled, and any blur may be that of differentiation: a lag of the drive shows at every reversal.
_SHARE = 0.2
# Time constants after which a low pass has forgotten: what is left is below a ten-thousandth.
_FORGOTTEN = 10.0


class ActuationLag(Effect):
    """Current and motion do not belong to the same moment.

    It adds no current of its own. Where `first_order` is 0 the current at time t is what the motion
    at t + lag asks for: positive where torque follows the current late, negative where the
    recorded current comes after the motion. Where it is 1, the recorded current is behind a
    first-order low pass of that time constant; where it is -1, the torque is, behind the current.
    """

    name = 'actuation_lag'
    variable = 'history'
    role = NEITHER
    constants = {'lag': Search(1.0, unit=lambda scene, _: scene.sample_time, joint_only=True),
                 'first_order': None}
    reshapes = True
    flexible = True
    not_fed_back = (
        'to make up for a delay the compensator would have to know the motion in advance')

    @classmethod
    def check(cls, values: dict[str, float]) -> None:
        """Refuse a time constant that is none."""
        super().check(values)
        if values['first_order'] not in (-1.0, 0.0, 1.0):
            raise InputError(f"first_order must be -1, 0 or 1, not {values['first_order']!r}")
        if values['first_order'] and values['lag'] <= 0:
            raise InputError(f"lag must be positive for a low pass, not {values['lag']!r}")

    @classmethod
    def grid(cls, scene: Scene) -> list[dict[str, float]]:
        """Lags of half a sample to some thirty, either way, and low passes of as much."""
        step = scene.sample_time
        steps = np.array([0.5, 1, 1.5, 2, 3, 4, 6, 8, 12, 16, 24, 32, 48, 64, 96, 128])
        steps = steps[steps * step <= _LONGEST]
        grid = [{'lag': float(side * value * step), 'first_order': 0.0}
                for value in steps for side in (1.0, -1.0)]
        return grid + [{'lag': float(value * step), 'first_order': side}
                       for value in steps for side in (1.0, -1.0)]

    @classmethod
    def forms(cls, scene: Scene) -> list[dict[str, float]]:
        """Return the constants that all samples of a recording are asked to choose between."""
        sizes = np.geomspace(scene.sample_time, max(_LONGEST, 2.0 * scene.sample_time), 14)
        return [{'lag': float(side * size), 'first_order': form}
                for form, side in ((0.0, 1.0), (0.0, -1.0), (1.0, 1.0), (-1.0, 1.0))
                for size in sizes]

    @staticmethod
    def columns(x: Signals, c: Any) -> tuple[Any, ...]:
        """Return no column."""
        return ()

    @classmethod
    def seen_by(cls, samples: Samples, constants: dict[str, float]) -> Samples:
        """Return the samples with the motion of the time t + lag."""
        return samples if constants['first_order'] else advance(samples, constants['lag'])

    @classmethod
    def recorded_as(cls, values: np.ndarray, samples: Samples,
                    constants: dict[str, float]) -> np.ndarray:
        """Return the current as its low pass leaves it."""
        return delayed(values, samples, constants['first_order'] * constants['lag'])

    @classmethod
    def reach(cls, constants: dict[str, float], samples: Samples) -> int:
        """Return how many samples away `recorded_as` looks: a low pass until it has forgotten."""
        if constants['first_order'] <= 0.0:
            return int(constants['first_order'] < 0.0)
        steps = _FORGOTTEN * constants['lag'] / max(samples.sample_time, 1e-9)
        # The next power of two: lags that differ little look at the same samples.
        return 1 << math.ceil(math.log2(max(steps, 1.0)))

    @classmethod
    def nearly_seen_by(cls, samples: Samples, constants: dict[str, float]) -> Samples:
        """Return the samples with a low pass taken for the delay that it nearly is."""
        return advance(samples, (-constants['first_order'] or 1.0) * constants['lag'])

    @classmethod
    def nearly(cls, constants: dict[str, float], samples: Samples) -> dict[str, float]:
        """Return constants with the lag in halves of a sample."""
        half = 0.5 * max(samples.sample_time, 1e-9)
        return {**constants, 'lag': half * round(constants['lag'] / half)}

    @classmethod
    def moved(cls, values: np.ndarray, samples: Samples,
              constants: dict[str, float]) -> np.ndarray:
        """Return values, shape (N, M), computed without a lag as they would be with one."""
        if constants['first_order']:
            return cls.recorded_as(values, samples, constants)
        return earlier(values, samples, constants['lag'])

    @classmethod
    def limited(cls, name: str, value: float, constants: dict[str, float], scene: Scene) -> float:
        """A low pass has a time constant above zero; nothing in a drive takes longer than this."""
        longest = max(_LONGEST, 2.0 * scene.sample_time)
        lowest = 0.1 * scene.sample_time if constants['first_order'] else -longest
        return min(max(value, lowest), longest)

    @classmethod
    def hard_to_tell(cls, scene: Scene) -> str:
        """Return why coarse positions show nothing of it."""
        return too_coarse(scene)

    @classmethod
    def plausible(cls, coefficients: Sequence[float] | np.ndarray, constants: dict[str, float],
                  scene: Scene) -> bool:
        """A fraction of a sample is how the signals were sampled, no effect."""
        return abs(constants['lag']) > 0.7 * scene.sample_time

    @classmethod
    def worth(cls, share: float, constants: dict[str, float], scene: Scene) -> float:
        """A lag blurs, as the differentiation of positions does, and so asks for more."""
        return max(share, _SHARE)

    def describe(self) -> str:
        """Return the effect in words."""
        lag = 1e3 * self.values['lag']
        if self.values['first_order'] > 0:
            return f'Lag: the recorded current is behind a low pass of {lag:.2g} ms'
        if self.values['first_order'] < 0:
            return f'Lag: torque is behind the recorded current by a low pass of {lag:.2g} ms'
        if lag < 0:
            return f'Lag: the recorded current comes {-lag:.2g} ms after the motion'
        return f'Lag: torque follows the recorded current by {lag:.2g} ms'

    def formula(self) -> str:
        """Return the formula with its numbers."""
        if self.values['first_order'] > 0:
            return f'all behind 1/(1 + {self.values["lag"]:.4g}·s)'
        if self.values['first_order'] < 0:
            return f'all before 1/(1 + {self.values["lag"]:.4g}·s)'
        return f'all terms at t {self.values["lag"]:+.4g} s'
