# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Sphinx: `make docs` builds build/docs/index.html, with warnings as errors."""

from pathlib import Path
import sys

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE.parent), str(HERE)]

import effect_pages  # noqa: E402 - stands in the folder just added

from friction_comp import __version__  # noqa: E402

project = 'friction_comp'
author = 'The friction_comp authors'
copyright = '2026, The friction_comp authors, Apache-2.0'
release = version = __version__
extensions = ['myst_parser', 'sphinx.ext.autodoc', 'sphinx.ext.napoleon', 'sphinx.ext.viewcode']
myst_enable_extensions = ['colon_fence']
myst_heading_anchors = 3
exclude_patterns = ['README.md']
html_theme = 'alabaster'
html_theme_options = {'description': 'Friction of geared robot drives', 'page_width': '1150px',
                      'fixed_sidebar': True}
html_sidebars = {'**': ['about.html', 'searchfield.html', 'navigation.html', 'relations.html']}
autodoc_member_order = 'bysource'
autodoc_typehints = 'none'
napoleon_google_docstring = False
napoleon_use_ivar = True
suppress_warnings = ['myst.xref_missing']

# Written from the classes before anything is read.
effect_pages.write_pages(HERE / 'effects')
effect_pages.write_thresholds(HERE / 'effects' / 'thresholds.inc')
