# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""What samples tell of themselves: every check of a signal, each with its one limit.

A fact is a function of arrays; it says what is so, in words or numbers, and decides nothing. Who
reads a file refuses it, who moves a motor commands zero, who refines or looks at a robot reports.
The functions also run in control loops, so they need NumPy alone.

====================================================  ==========================================
`motion.impossible`                                   values and jumps that no joint can have
`motion.velocity_agreement`, `VelocityCheck`          velocity contradicts position
`motion.not_in_radians`, `not_in_seconds`             units that cannot be
`motion.turns_of`, `glitches`                         wrapped angles, positions that jump and return
`timing.rhythm`, `gap_length`, `lost_rows`            rate, gaps, rows that are missing
`timing.held_rows`, `recorded.tidied`                 rows that repeat what was measured before
`motion.positions`, `encoder_fault`                   steps of an encoder
`current.current_answer`, `CurrentCheck`, `gain_fault`  measured against commanded current, delay
`current.saturated`, `wrong_sign`                     limits of a current, its sign
====================================================  ==========================================
"""
