# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Simulated fleets: which units are called out, and times.

Odd seeds are reported; even ones were looked at while the comparison was made.

    python3 bench/fleet_table.py --units 40 --seeds 5 --faults coulomb inertia bump
    python3 bench/fleet_table.py --units 40 --seeds 7 9
    python3 bench/fleet_table.py --false-alarms 400
"""

import json
from pathlib import Path
import tempfile

from bench_tools import table_parser
from many_recordings import timed
import numpy as np

from friction_comp.fleet.population import spread_of, units_from_recordings
from simulated_recordings.fleet import FAULTS, write_fleet


def fleets(arguments):
    """Refine whole fleets; print which units are called out."""
    for seed in arguments.seeds:
        folder = (arguments.keep or Path(tempfile.mkdtemp())) / f'fleet_{seed}'
        odd = write_fleet(folder / 'units', seed, arguments.units, arguments.faults)
        spent, cpu, peak = timed(['refine', folder / 'units', '--each', '--jobs',
                                  arguments.jobs, '--output', folder / 'out'])
        content = json.loads((folder / 'out' / 'report.json').read_text())
        found = {name: what for out in content['out'].values() for name, what in out.items()}
        print(f'fleet {seed}: {arguments.units} units, odd {odd or "none"}; called out {found}; '
              f'missed {sorted(set(odd) - set(found))}, false {sorted(set(found) - set(odd))}; '
              f'{spent:.0f} s, {cpu:.0f} s of processor time, {peak:.0f} MB', flush=True)


def false_alarms(count):
    """Print how often a unit is called out in fleets without an odd one, by the statistics alone.

    Of 8 parameters with errors of a third of the spread; and how often one of 3 odd ones is found.
    """
    rng = np.random.default_rng(1)
    for label, units, per_unit in (('40 units', 40, 1), ('10 units', 10, 1),
                                   ('40 units, three recordings each', 40, 3)):
        alarms, found, tried = 0, np.zeros(3), 0
        for number in range(count):
            alarms += any(spread_of(fleet_values(rng, rng.standard_normal(units), per_unit), 8
                                    ).out.any() for _ in range(8))
            tried += number % 5 == 0
            for k, size in enumerate((5.0, 7.0, 9.0) if number % 5 == 0 else ()):
                truth = rng.standard_normal(units)
                truth[:3] += size
                found[k] += spread_of(fleet_values(rng, truth, per_unit), 8).out[:3].mean()
        print(f'{label}: a unit of 8 parameters called out in {100 * alarms / count:.1f} % of '
              'fleets; of 3 odd units, 5, 7 and 9 spreads away, found '
              + ', '.join(f'{100 * share / tried:.0f} %' for share in found), flush=True)


def fleet_values(rng, truth, per_unit):
    """Return what the comparison gets of measured units."""
    unit = np.repeat(np.arange(len(truth)), per_unit)
    error = 0.33 * np.exp(0.3 * rng.standard_normal(len(unit)))
    values = truth[unit] + 0.3 * (per_unit > 1) * rng.standard_normal(len(unit))
    values = values + error * rng.standard_normal(len(unit))
    told = error * np.sqrt(rng.chisquare(15, len(unit)) / 15)
    return units_from_recordings(values, told, unit)


def main():
    """Measure and print."""
    parser = table_parser(__doc__, units=40, jobs=2)
    parser.add_argument('--seeds', type=int, nargs='+', default=[5])
    parser.add_argument('--faults', nargs='*', default=[], choices=list(FAULTS))
    parser.add_argument('--keep', type=Path, help='folder in which the fleets stay')
    parser.add_argument('--false-alarms', type=int, metavar='FLEETS')
    arguments = parser.parse_args()
    if arguments.false_alarms:
        false_alarms(arguments.false_alarms)
    else:
        fleets(arguments)


if __name__ == '__main__':
    main()
