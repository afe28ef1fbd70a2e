# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The only place where the second world meets the package: what is judged, and plain data."""

from __future__ import annotations

from friction_comp import Drive, read_recording, refine, Samples
from friction_comp.recordings import write_samples

__all__ = ['Drive', 'Samples', 'predict', 'read_recording', 'refine', 'write_samples']


def predict(model, samples):
    """Return the current in A, shape (N,), that a model expects for raw samples."""
    return model.predict(samples)
