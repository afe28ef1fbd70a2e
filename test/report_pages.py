# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Compares the JSON that the tools write with its description in msg_docs/reports.md."""

from pathlib import Path
import re

PAGE = (Path(__file__).resolve().parent.parent / 'msg_docs' / 'reports.md').read_text(
    encoding='utf-8')


def promised(tool):
    """Return the entries in the tables of the page's section on a tool."""
    section = re.search(rf'^## {re.escape(tool)}\n(.*?)(?=^## |\Z)', PAGE,
                        re.MULTILINE | re.DOTALL)[1]
    rows = re.findall(r'^\| (`.*)$', section, re.MULTILINE)
    return {name for row in rows for name in re.findall(r'`(\w+)`', row)}


def assert_documented(report, tool):
    """Compare a report's version and entries with its section of the page."""
    assert report['version'] == 1
    left = set(report) - promised(tool) - {'version'}
    assert not left, f'msg_docs/reports.md does not name {left} of {tool}'
