# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Reads and writes recordings: rosbag2 folders, mcap files and tables."""

from friction_comp.recordings.activity import Activity
from friction_comp.recordings.joint_samples import RecordingInfo
from friction_comp.recordings.reader import (
    read_arm,
    read_joints,
    read_recording,
    read_recording_with_info,
    stream_recording_with_info,
)
from friction_comp.recordings.samples_writer import write_samples
from friction_comp.recordings.sources import find_recording, find_recordings, recorded_joints
from friction_comp.recordings.writer import RecordingWriter

__all__ = [
    'Activity', 'RecordingInfo', 'RecordingWriter', 'find_recording', 'find_recordings',
    'read_arm', 'read_joints', 'read_recording', 'read_recording_with_info', 'recorded_joints',
    'stream_recording_with_info', 'write_samples',
]
