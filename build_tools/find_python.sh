#!/bin/sh
# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
#
# Prints the interpreter that the environment is made with: the one named as argument, else the
# first that will do. Says on standard error what is missing when there is none.

fail() {
    echo "friction_comp: $1" >&2
    exit 1
}

if [ -z "$ROS_DISTRO" ] && [ "$(uname -s) $(uname -m)" != 'Linux x86_64' ]; then
    fail "the ROS 2 wheels are for Linux on x86-64, not $(uname -s) $(uname -m): \
source a ROS 2 installation"
fi
command -v c++ >/dev/null || command -v g++ >/dev/null || command -v clang++ >/dev/null ||
    fail 'there is no C++ compiler; on Debian and Ubuntu: apt install g++'

needed='import sys, venv, ensurepip'
# An installation's rclpy is compiled for one Python; only that one will do.
[ -z "$ROS_DISTRO" ] || needed="$needed, rclpy"

candidates=${1:-python3 python3.13 python3.12 python3.11 python3.10 python3.14}
for python in $candidates; do
    if "$python" -c "$needed; sys.exit(not (3, 10) <= sys.version_info < (3, 15))" >/dev/null 2>&1
    then
        command -v "$python"
        exit 0
    fi
done
wanted="no Python of version 3.10 to 3.14 (${1:-python3}) that has venv"
[ -z "$ROS_DISTRO" ] || fail "$wanted and imports rclpy of ROS 2 $ROS_DISTRO"
fail "$wanted; on Debian and Ubuntu: apt install python3-venv"
