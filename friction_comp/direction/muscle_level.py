# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The level of a raw muscle signal (electromyogram), in blocks of 10 ms, as it arrives.

A causal high pass removes what electrodes and skin do when the arm moves. The energy of a block at
rest has the distribution of a sum of squares, whose cube root is nearly normal (Wilson and Hilferty
1931): what the onset test asks for.
"""

from __future__ import annotations

from collections import deque

import numpy as np
from scipy.signal import butter, sosfilt

from friction_comp.errors import InputError

BLOCK = 0.01
"""Length of a block, s: six of them are the shortest contraction."""
# Movement artefacts lie below it, Hz (De Luca et al. 2010).
_HIGH_PASS = 20.0
_LEAST_RATE = 200.0
# Frequencies of mains, Hz, of which odd harmonics come through, and share of the power that is
# theirs in hum. In a muscle's signal it is 0.25 on average within the short window, and 0.07 within
# the long one, s.
_MAINS, _HARMONICS, _HUM = (50.0, 60.0), (1, 3), 0.8
SHORT, LONG = 0.03, 0.2


class MuscleLevel:
    """Turns samples of one channel, `rate` per second, into levels of blocks.

    Raises InputError if the rate is too small for a raw signal.
    """

    def __init__(self, rate: float) -> None:
        if rate < _LEAST_RATE:
            raise InputError(f'{rate:.0f} samples per second are too few for a raw muscle signal, '
                             f'which needs {_LEAST_RATE:.0f}: send its envelope')
        self.block_rate = rate / max(2, round(BLOCK * rate))
        self._size = max(2, round(BLOCK * rate))
        self._filter = butter(2, _HIGH_PASS, 'high', fs=rate, output='sos')
        self._state: np.ndarray | None = None
        self._left = np.zeros(0)
        self._window: deque[float] = deque(maxlen=round(LONG * rate))
        self._waves = {window: [_waves(round(window * rate), mains / rate) for mains in _MAINS]
                       for window in (SHORT, LONG)}

    def add(self, values: np.ndarray) -> np.ndarray:
        """Return the levels of the blocks that values, shape (N,), complete."""
        if self._state is None:
            # As if the first value had always been there.
            self._state = np.zeros((len(self._filter), 2))
            self._offset = float(values[0])
        filtered, self._state = sosfilt(self._filter, values - self._offset, zi=self._state)
        self._window.extend(filtered)
        self._left = np.concatenate([self._left, filtered])
        blocks = len(self._left) // self._size
        whole, self._left = np.split(self._left, [blocks * self._size])
        energy = np.mean(whole.reshape(blocks, self._size)**2, axis=1)
        return np.cbrt(energy)

    def hums(self, window: float = LONG) -> bool:
        """Return whether the last `window` s, SHORT or LONG, are hum of the mains."""
        waves = self._waves[window]
        count = len(waves[0])
        if len(self._window) < count:
            return False
        last = np.array(self._window)[-count:]
        power = float(last @ last)
        return power > 0.0 and any(
            float(np.sum((last @ own)**2)) > _HUM * power for own in waves)


def _waves(count: int, frequency: float) -> np.ndarray:
    """Return an orthonormal basis of a frequency, in cycles per sample, and its harmonics."""
    phase = 2.0 * np.pi * frequency * np.arange(count)
    return np.asarray(np.linalg.qr(np.column_stack(
        [wave(k * phase) for k in _HARMONICS if k * frequency < 0.5 for wave in (np.sin, np.cos)]
    ))[0])
