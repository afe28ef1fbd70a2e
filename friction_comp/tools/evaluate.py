# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The tool ``evaluate``: the note's Fig. 5 from recordings."""

from __future__ import annotations

from friction_comp.tools.common import Arguments, output_folder, progress, to_json

_SIGNALS = ('direction', 'reference', 'interaction_wrench')


def main(argv: list[str] | None = None) -> int:
    """Evaluate the back-driving torque of recorded trials.

    Parameters
    ----------
    argv : list of str, optional
        The process's own arguments by default.

    Returns
    -------
    int
        0.

    Raises
    ------
    InputError
        If a recording cannot be used.
    """
    arguments = Arguments('evaluate', __doc__).add_recordings().add_output().parse(argv)
    from friction_comp.evaluation.conditions import evaluate
    from friction_comp.recordings import read_recording_with_info
    from friction_comp.reports.evaluation_report import evaluation_report, summary
    from friction_comp.reports.html import number

    with progress('reading') as report:
        found = read_recording_with_info(
            arguments.recordings, arguments.joint, signals=_SIGNALS, progress=report,
            others=False)
        report(1.0, 'evaluating')
        names = [str(info.path) for _, info in found]
        models = list(dict.fromkeys(info.model for _, info in found if info.model))
        evaluation = evaluate([samples for samples, _ in found], names, ', '.join(models) or None)
        for _, info in found:
            evaluation.notes.extend(f'{info.path}: {note}' for note in info.notes)
        with output_folder(arguments.output) as folder:
            (folder / 'report.json').write_text(to_json(evaluation.as_dict()), encoding='utf-8')
            evaluation_report(evaluation, names).save(folder / 'report.html')
    for condition in evaluation.conditions:
        print(f'd = {condition.direction:+d}, {condition.movement} movement: peak '
              f'{number(condition.peak_torque)} ± {number(condition.peak_torque_std)} N·m, RMS '
              f'{number(condition.rms_torque)} N·m ({condition.repetitions} repetitions)')
    print(summary(evaluation).replace('**', ''))
    print(arguments.output / 'report.html')
    return 0
