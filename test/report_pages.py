# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""What msg_docs/reports.md promises of the JSON that the tools write."""

from pathlib import Path
import re

PAGE = (Path(__file__).resolve().parent.parent / 'msg_docs' / 'reports.md').read_text(
    encoding='utf-8')


def promised(tool):
    """Return the entries that the page's section on a tool names, in its tables."""
    section = re.search(rf'^## {re.escape(tool)}\n(.*?)(?=^## |\Z)', PAGE,
                        re.MULTILINE | re.DOTALL)[1]
    rows = re.findall(r'^\| (`.*)$', section, re.MULTILINE)
    return {name for row in rows for name in re.findall(r'`(\w+)`', row)}


def assert_documented(report, tool):
    """Hold a report against its section of the page: its version, and each of its entries."""
    assert report['version'] == 1
    left = set(report) - promised(tool) - {'version'}
    assert not left, f'msg_docs/reports.md does not name {left} of {tool}'
