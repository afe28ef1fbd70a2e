# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Records the package's topics to a rosbag2 folder for evaluate, refine and ros2 bag."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from rclpy.node import Node

from friction_comp.errors import InputError
from friction_comp.recordings.writer import RecordingWriter
from friction_comp.ros.dated_topics import DatedTopics, RECORDED, STATES
from friction_comp.ros.node_parts import Diagnostics, ERROR, first_of, OK, Rate, Settings, WARN
from friction_comp.ros.ros_start import steady_timer


class RecorderNode(Node):
    """Writes every serialised message at once, and counts lost ones."""

    # Nothing waits for a recording: messages are processed in batches.
    batch_time = 0.005

    def __init__(self) -> None:
        super().__init__('recorder')
        settings = Settings(self, 'recorder')
        output, model = settings['output'], settings['model_file']
        self._rate, self._counts = Rate(), dict.fromkeys(RECORDED, 0)
        # No more messages are written, and why, if something went wrong.
        self._ended, self._failed = False, ''
        self._writer = RecordingWriter(output, {
            'recorded_by': 'friction_comp recorder', **({'model_file': model} if model else {})})
        self._dated = DatedTopics(self, self._write)
        self._topics = self._dated.topics
        steady_timer(self, 0.25, self._flush)
        self._diagnostics = Diagnostics(self, self._report, [output], 'recording')

    @contextmanager
    def _note_failure(self) -> Iterator[None]:
        try:
            yield
        except InputError as error:
            self._failed, self._ended = str(error), True
            raise

    def _flush(self) -> None:
        if not self._ended:
            with self._note_failure():
                self._writer.flush()
                # An open file that was deleted takes messages without an error.
                if not any(self._writer.path.glob('*.mcap')):
                    raise InputError(f'{self._writer.path}: was deleted while it was written: '
                                     'nothing is recorded any more')

    def _write(self, topic: str, stamp: int, cdr: bytes) -> None:
        if self._ended:
            return
        self._counts[topic] += 1
        self._rate.count += 1
        with self._note_failure():
            # With the resolved name, so that namespaces and remappings are kept in playback.
            self._writer.write(self._topics[topic].name, RECORDED[topic], stamp, cdr)

    def _describe_lost(self) -> str:
        return ', '.join(f'{topic.lost} {name}' for name, topic in self._topics.items()
                         if topic.lost)

    def _report(self) -> tuple[Any, ...]:
        lost = sum(topic.lost for topic in self._topics.values())
        # Received, but not written before the joint states that date them arrive.
        waiting = Counter(topic for _, topic, *_ in self._dated.waiting)
        values = {'messages per second of real time': self._rate.per_second(),
                  'messages lost': lost,
                  **{topic: count + waiting[topic] for topic, count in self._counts.items()},
                  **{f'publishers of {name}': topic.publisher_count
                     for name, topic in self._topics.items()}}
        return first_of(
            values, (self._failed, ERROR, self._failed),
            (lost, WARN, f'messages lost: {self._describe_lost()}'),
            (self._counts[STATES], OK, 'recording'), (True, WARN, 'no joint_states yet'))

    def leave(self) -> None:
        """Write the waiting messages and finish the recording."""
        if self._failed:
            # The node ended before the next time to publish.
            self._diagnostics.publish()
            return
        with self._note_failure():
            self._dated.finish()
            for topic, kind in RECORDED.items():
                self._writer.add_topic(self._topics[topic].name, kind)
            lost = self._describe_lost()
            if lost:
                self._writer.custom_data['messages_lost'] = lost
            self._ended = True
            self._writer.close()
        if lost:
            self.get_logger().error(f'{self._writer.path}: messages lost: {lost}')
        self.get_logger().info(f'{self._writer.path}: ' + ', '.join(
            f'{count} {topic}' for topic, count in self._counts.items() if count))
