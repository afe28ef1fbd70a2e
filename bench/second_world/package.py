# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The only place where the second world meets the package: what is judged, and plain data."""

from __future__ import annotations

from friction_comp.drive import Drive
from friction_comp.samples import Samples

try:
    from friction_comp import read_recording, refine
except ImportError:
    from friction_comp.recordings import read_recording
    from friction_comp.refinement import refine
from friction_comp.recordings import write_samples

try:
    from friction_comp.refinement import predict
except ImportError:
    def predict(model, samples):
        """Return the current in A, shape (N,), that a model expects for raw samples."""
        return model.predict(samples)

__all__ = ['Drive', 'Samples', 'predict', 'read_recording', 'refine', 'write_samples']
