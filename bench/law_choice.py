# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""What each law takes of friction from a hand that moves to and fro, and leaves when it lets go.

    python3 bench/law_choice.py --seed 93 --output laws.json
    python3 docs/generate.py laws laws.json

The rows of `law_table` on to-and-fro at three tempos and on letting go (models up to 1.05 times the
truth), for the laws and the rivals that one may choose among. The second command writes them into
docs/results.md. Even seeds are for tuning on, odd seeds are kept for judging. It takes a few
minutes of processor time.
"""

import json
from pathlib import Path

from bench_tools import table_parser
import numpy as np

from law_judge.alone import watch_release
from law_judge.bank import Joints, make_bank
from law_judge.hands import swaying
from law_judge.loop import KINETIC, TANH, YARDSTICKS
from world import gear

FREQUENCIES = (0.3, 0.6, 1.0)    # Hz
# Whether the gear's presliding distance is known; law and how its direction comes, by name.
WAYS = {True: {'announced': ('continuous', 'announced'), 'unknown': ('continuous', 'd = 0')},
        False: {'unmeasured': ('continuous', 'd = 0'), TANH: (TANH, 'd = 0'),
                KINETIC: (KINETIC, 'd = 0')}}


def main():
    parser = table_parser(__doc__, seed=0, draws=1)
    parser.add_argument('--output', type=Path, help='JSON file to write')
    options = parser.parse_args()
    found, gone = {}, {}
    bank = make_bank(gear, gear.KINDS, options.draws, options.seed)
    for known, ways in WAYS.items():
        told = bank.telling(known)
        tried = {name: way for name, way in ways.items() if name not in YARDSTICKS}
        joints, shares = swaying(told, FREQUENCIES, tried)
        for name, (law, how) in ways.items():
            found[name] = [[float(figure(shares[name][joints['frequency'] == f]))
                            for figure in (np.nanmedian, np.nanmin)] for f in FREQUENCIES]
            moving = watch_release(Joints(told, speed=[5, 40, 80], factor=[1.0, 1.05],
                                          direction=[int(how == 'announced')]), law)['moving']
            gone[name] = [int(moving.sum()), len(moving)]
            print(f'{name:12s}' + ''.join(f'{median:6.0f} ({worst:.0f}) %'
                                          for median, worst in found[name])
                  + '   let go, moves on: {} of {}'.format(*gone[name]), flush=True)
    if options.output:
        options.output.write_text(json.dumps({
            'seed': options.seed, 'draws': options.draws, 'gears': len(bank.gears),
            'frequencies': FREQUENCIES, 'laws': found, 'moving': gone}, indent=1) + '\n',
            encoding='utf-8')


if __name__ == '__main__':
    main()
