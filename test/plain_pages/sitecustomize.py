# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Python runs this first in processes that tests start: their pages are without Bokeh, too."""

import sys

sys.modules['bokeh'] = None
