# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Reads and writes recordings: rosbag2 folders, mcap files and tables."""

BAGS, METADATA = ('.mcap', '.db3', '.mcap.zstd', '.db3.zstd'), 'metadata.yaml'
"""Suffixes of the files of bags, and the name of the one that describes a folder."""
