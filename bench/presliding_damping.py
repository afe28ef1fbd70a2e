# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""What the note's figures owe to the presliding damping that was chosen for its drives.

    python3 bench/presliding_damping.py [--seed N] [--shares C ...]

The note does not say how a joint at rest vibrates. Each line of the table has the mean peak of the
back-driving torque of one drive of config/ in N·m, compensated with its own, exact model, as the
damping of presliding is what config/ has (a share of critical damping, printed) or a given share.
"""

from dataclasses import dataclass, replace
import math

from bench_tools import table_parser

from friction_comp.note.condition_runs import mean_peak, run_trial
from friction_comp.note.published import Experiment, EXPERIMENTS
from friction_comp.simulation.joint_parameters import joint_parameters

LAWS = ('kinetic', 'paper', 'continuous')


@dataclass(frozen=True)
class Damped(Experiment):
    """An experiment whose simulated joint has another presliding damping.

    `share`: float or None; of critical damping; None keeps what the model file has.
    """

    share: float | None = None

    def model(self):
        model = super().model()
        if self.share is None:
            return model
        factor = self.share / share_of(model)
        return replace(model, simulation={
            **model.simulation,
            'presliding_damping': factor * model.simulation['presliding_damping']})


def share_of(model):
    """Return the presliding damping of a model's joint as a share of critical damping."""
    p = joint_parameters(model)
    return float(p['bristle_damping'] / (
        2.0 * math.sqrt(p['bristle_stiffness'] * p['motor_inertia'])))


def peaks(experiment, seed):
    model = experiment.model()
    return [mean_peak(run_trial(experiment, model, law, seed)) for law in LAWS]


def main():
    parser = table_parser(__doc__, seed=1)
    parser.add_argument('--shares', type=float, nargs='+', default=[1.0, 0.5], metavar='C')
    arguments = parser.parse_args()
    print('configuration   damping / critical   d = 0   printed law, d = ±1   continuous law')
    for experiment in EXPERIMENTS:
        for share in (None, *arguments.shares):
            damped = Damped(**vars(experiment), share=share)
            found = peaks(damped, arguments.seed)
            print(f'{experiment.number:13d} {share_of(damped.model()):20.2f} '
                  f'{found[0]:7.2f} {found[1]:21.2f} {found[2]:16.2f}', flush=True)


if __name__ == '__main__':
    main()
