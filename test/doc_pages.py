# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Reads the documentation's pages and the code blocks in them."""

import importlib.util
import re

from helpers import ROOT

PAGES = [path for path in (
    ROOT / 'README.md', ROOT / 'CONTRIBUTING.md', *sorted((ROOT / 'docs').glob('*.md')),
    *sorted((ROOT / 'msg_docs').glob('*.md'))) if path.exists()]


def script(name):
    """Import a script of the documentation."""
    spec = importlib.util.spec_from_file_location(name, ROOT / 'docs' / f'{name}.py')
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def blocks(language, pages=PAGES):
    """Yield the code blocks of a language with page and line, also those within lists."""
    for page in pages:
        text = page.read_text(encoding='utf-8')
        for match in re.finditer(r'^( *)```(\w*)\n(.*?)^\1```', text, re.DOTALL | re.MULTILINE):
            if match[2] == language:
                lines = [line[len(match[1]):] for line in match[3].splitlines()]
                number = text[:match.start()].count('\n') + 1
                yield '\n'.join(lines), f'{page.name}:{number}'


def commands(pages=PAGES):
    """Yield every command once, with the first page and line where it occurs."""
    found = {}
    for block, place in blocks('sh', pages):
        for line in block.replace('\\\n', ' ').splitlines():
            command = line.split('#')[0].strip()
            if command:
                found.setdefault(command, (line.strip(), place))
    return list(found.values())
