# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The continuous compensation law: breakaway friction paid until the joint moves, without a gap.

The printed law drops the breakaway term at the first encoder count, when the joint has hardly
begun to move, and pays 90 % of the mean breakaway current on a joint whose breakaway scatters by
several per cent. This one finds out what the joint bears before anybody pushes (`probe`), answers
a push while the joint still sticks (`push_help`), and goes over from breakaway to kinetic friction
as a continuous function of velocity (`continuous_current`).
"""

from __future__ import annotations

import math

from numba import njit

from friction_comp.compensation.law_columns import (
    AIM,
    ASSIST,
    BACK_SPEED,
    BEGUN,
    BREAK_NEGATIVE,
    BREAK_POSITIVE,
    BREAKAWAY_TERM,
    FARTHEST,
    HELD,
    HELP,
    KINETIC_SHARE,
    KINETIC_TERM,
    LEVEL,
    LOWER,
    MARK,
    MOST_NEGATIVE,
    MOST_POSITIVE,
    ORIGIN,
    PHASE,
    PLACE,
    PRESLIDING,
    QUIET,
    RESOLUTION,
    RISE_TIME,
    SAFE_NEGATIVE,
    SAFE_POSITIVE,
    SINCE,
    SLIPPED,
    SPEED,
    STEEPNESS,
    STEP,
    UPPER,
    VISCOUS,
    WATCH_SPEED,
    WATCHED,
    WINDOW,
    WINDOW_COUNTS,
    WINDOW_PLACE,
)

# Phases of the continuous law: no direction; the level rises on a joint at rest; it has borne the
# level and the level steps back; it is held; the joint moves; it is moved against the direction.
NOTHING, PROBING, BACKING, READY, MOVING, OPPOSED = range(6)
# A joint whose encoder has not moved for so long is at rest, s; a new rest takes longer.
QUIET_TIME = 0.05
REST_TIME = 0.1
NEW_REST_TIME = 0.3
# What a joint that slips while it is probed gives back of the level, and how fast, s.
RETREAT = 0.9
RETREAT_TIME = 0.01
# Bristles under load creep ever more slowly, a slipping joint does not: it bears the level once it
# gives by fewer than these counts in two windows of this length, s, and slips if it gives by more
# in one without slowing down.
WINDOW_TIME = 0.05
REST_COUNTS = 1.5
SLIP_COUNTS = 3.0
# Once the level no longer rises they give way for about so long, s.
GIVE_TIME = 0.03
# At this share of the level at which it first gave, a joint that nobody pushes slows down and
# stops, below so many counts a sample. One that keeps its speed for so long, s, or gains speed in
# half of that time, is being pushed.
PUSHED = 0.7
STOPPED_COUNTS = 0.3
WATCH_TIME = 0.014
KEEPS = 0.7
GAINS = 1.2
# After the step back it must not go forward by this part of a count for so long, s.
FORWARD_COUNTS = 0.7
PROOF_TIME = 0.3
# A joint that still has not come to rest so long after slips, s.
RESTLESS_TIME = 0.6
# The level steps back to this share of what the joint has borne.
BACKED = 0.97
# Counts by which the joint must be deflected before that counts as a push.
PUSH_COUNTS = 0.5
# The kinetic term comes in so slowly where the joint moved during the probe, s.
BLEND_TIME = 0.012
# To the level that every rest bears it rises so much faster than on from there, where a joint that
# slips has to be noticed in time.
ONSET = 4.0
# A joint this fast is being moved, rad/s; so is one that went so much farther, rad, than it gives.
MOVED_SPEED = math.radians(3.5)
MOVED_WAY = math.radians(0.1)
# A joint that creeps and is let go is to stop, not to gather speed: the level stays below this
# share of sliding friction, and all current where the kinetic term alone is not higher.
MOVING_SHARE = 0.9
CREEP_SHARE = 0.97
# Share of the kinetic term that is left out below about this speed while there is no direction.
REST_SHARE = 0.15
REST_SPEED = math.radians(2.0)
# Below about this speed a joint creeps, rad/s.
CREEP_SPEED = 0.05
# The place of rest follows slow creep under load so slowly, s.
CREEP_TIME = 1.0


@njit(cache=True)
def smooth(share):
    """Return 0 below 0, 1 above 1 and the cubic between them whose ends are level."""
    share = min(1.0, max(0.0, share))
    return share * share * (3.0 - 2.0 * share)


@njit(cache=True)
def approach(value, aim, most):
    """Return `value` moved towards `aim` by at most `most`."""
    return value + min(most, max(-most, aim - value))


@njit(cache=True)
def begin_probe(s, sign, wanted):
    """Start to raise the level on a joint at rest."""
    s[PHASE] = PROBING
    s[MARK] = sign * s[PLACE]
    s[BEGUN] = sign * s[LEVEL]
    s[SINCE] = 0.0
    s[HELD] = 0.0
    s[WINDOW] = 0.0
    s[WINDOW_PLACE] = s[MARK]
    s[WINDOW_COUNTS] = 0.0
    s[AIM] = wanted
    s[SLIPPED] = 0.0
    s[WATCHED] = 0.0


@njit(cache=True)
def probe(p, s, sign):
    """Raise the level on a joint at rest and find out what it bears.

    Breakaway scatters from one rest to the next, so that the mean says little about this one. The
    level rises before anybody pushes: if the joint begins to slip all the same, the level goes
    back, a tenth at a time, until it stands. Kinetic friction is not compensated meanwhile, so
    that the slip stops as soon as the level retreats. What it has borne it goes on bearing with a
    little less, so that from then on only a push can move it. A gear that sticks still gives, and
    the encoder shows by how much: that is the stiffness a later push is measured with.
    """
    place = sign * s[PLACE]
    along = sign * s[SPEED]
    level = sign * s[LEVEL]
    s[SINCE] += s[STEP]
    deflection = place - s[MARK]
    wanted = p[BREAK_POSITIVE] if sign > 0.0 else p[BREAK_NEGATIVE]
    if abs(deflection) > p[FARTHEST] or abs(s[SPEED]) > MOVED_SPEED:
        s[PHASE] = MOVING if along > 0.0 else OPPOSED
        return
    count_speed = p[RESOLUTION] / max(s[STEP], 1e-6)
    s[HELD] = s[HELD] + s[STEP] if level == s[AIM] else 0.0
    # While the level rises, and for a moment after, the bristles' giving way is to be expected.
    giving = max(0.0, deflection) / s[SINCE] * math.exp(-s[HELD] / GIVE_TIME)
    slips = along > 0.7 * count_speed + 2.0 * giving
    rests = False
    s[WINDOW] += s[STEP]
    if s[PHASE] == BACKING:
        # It recoils as the level steps back. If it ever goes forward again, it still slips.
        s[WINDOW_PLACE] = min(s[WINDOW_PLACE], place)
        slips |= place - s[WINDOW_PLACE] > FORWARD_COUNTS * p[RESOLUTION]
        rests = s[HELD] > PROOF_TIME
    elif s[WINDOW] >= WINDOW_TIME:
        counts = (place - s[WINDOW_PLACE]) / p[RESOLUTION]
        s[WINDOW] = 0.0
        s[WINDOW_PLACE] = place
        if s[HELD] > 2.0 * WINDOW_TIME:
            rests = abs(counts) + abs(s[WINDOW_COUNTS]) < REST_COUNTS
        if s[HELD] > WINDOW_TIME:
            slips |= counts > SLIP_COUNTS and counts > 0.8 * s[WINDOW_COUNTS]
        s[WINDOW_COUNTS] = counts
    if s[WATCHED] > 0.0:
        rests = False
        s[WATCHED] += s[STEP]
        # Either it is being pushed, or it has come to rest and bears what is left of the level.
        if along < STOPPED_COUNTS * count_speed or (
                s[WATCHED] > WATCH_TIME and along >= KEEPS * s[WATCH_SPEED]) or (
                s[WATCHED] > 0.5 * WATCH_TIME and along >= GAINS * s[WATCH_SPEED]):
            s[AIM] = level
            s[ORIGIN] = place
            s[PHASE] = READY
            return
    elif 0.0 < level <= s[AIM] and (slips or s[HELD] > RESTLESS_TIME):
        if s[SLIPPED] == 0.0:
            s[SLIPPED] = level
        if RETREAT * level < PUSHED * s[SLIPPED]:
            s[WATCHED] = s[STEP]
            s[WATCH_SPEED] = along
        else:
            s[AIM] = RETREAT * level
        s[PHASE] = PROBING
        s[HELD] = 0.0
        rests = False
    if level > s[AIM]:
        s[LEVEL] = sign * approach(level, s[AIM], wanted * s[STEP] / RETREAT_TIME)
    else:
        safe = p[SAFE_POSITIVE] if sign > 0.0 else p[SAFE_NEGATIVE]
        rate = wanted * s[STEP] / p[RISE_TIME]
        s[LEVEL] = sign * max(
            min(approach(level, s[AIM], ONSET * rate), safe), approach(level, s[AIM], rate))
    if not rests:
        return
    if s[PHASE] == BACKING:
        s[ORIGIN] = place
        s[PHASE] = READY
        return
    stiffness = 0.0
    if p[RESOLUTION] < deflection and s[AIM] > s[BEGUN]:
        stiffness = (s[AIM] - s[BEGUN]) / (deflection + p[RESOLUTION])
    # A hand that leans against the joint meanwhile makes it look stiffer than it is.
    if s[PRESLIDING] > 0.0:
        stiffness = min(stiffness, 1.3 * s[PRESLIDING])
    s[PRESLIDING] = stiffness
    s[AIM] *= BACKED
    s[HELD] = 0.0
    s[WINDOW_PLACE] = place
    s[PHASE] = BACKING


@njit(cache=True)
def push_help(p, s, sign):
    """Return the current in A by which a person's push changes the resting level.

    A deflection beyond the place where the joint rested can only be a push. It is answered with
    the share ASSIST of the current that would have made it; below 1 that is stable, and a joint
    that nobody pushes gets nothing. A push against the direction takes from the level instead.
    """
    place = sign * s[PLACE]
    level = sign * s[LEVEL]
    most = p[MOST_POSITIVE] if sign > 0.0 else p[MOST_NEGATIVE]
    moved = place - s[ORIGIN]
    dead = PUSH_COUNTS * p[RESOLUTION]
    way = MOVED_WAY
    if s[PRESLIDING] > 0.0:
        way += 2.0 * most / s[PRESLIDING]
    if abs(moved) > way:
        s[PHASE] = MOVING if moved > 0.0 else OPPOSED
        return 0.0
    if moved > -2.0 * p[RESOLUTION]:
        s[ORIGIN] += moved * s[STEP] / CREEP_TIME
    if moved >= 0.0:
        return max(0.0, min(most - level, p[ASSIST] * s[PRESLIDING] * (moved - dead)))
    return min(0.0, max(-level, p[ASSIST] * s[PRESLIDING] * (moved + dead)))


@njit(cache=True)
def moving_level(p, s, sign, step):
    """Lead the level of a joint that moves in the direction, and probe anew where it rests."""
    wanted = p[BREAK_POSITIVE] if sign > 0.0 else p[BREAK_NEGATIVE]
    aim = p[SAFE_POSITIVE] if sign > 0.0 else p[SAFE_NEGATIVE]
    level = sign * s[LEVEL]
    if sign * s[SPEED] < -p[BACK_SPEED]:
        s[PHASE] = OPPOSED
    elif s[QUIET] <= REST_TIME:
        sliding = MOVING_SHARE * max(wanted, p[UPPER] if sign > 0.0 else -p[LOWER])
        aim = max(min(aim, sliding), min(level, wanted, sliding))
    elif level == aim and wanted > 0.0:
        begin_probe(s, sign, wanted)
    s[LEVEL] = sign * approach(level, aim, step)


@njit(cache=True)
def turn_level(p, s, direction):
    """Lead the level of the breakaway term through its phases; return its sign and size in A."""
    step = max(p[BREAK_POSITIVE], p[BREAK_NEGATIVE]) * s[STEP] / p[RISE_TIME]
    # The faster the joint moves, the less the level has to say: it may go so much faster without
    # a jump in current, lest it drive on a joint that is to stop.
    moving = s[KINETIC_SHARE] * math.tanh(0.5 * p[STEEPNESS] * abs(s[SPEED]))
    leave = step / max(1.0 - moving, 0.05)
    sign = 1.0 if s[LEVEL] > 0.0 or (s[LEVEL] == 0.0 and direction > 0.0) else -1.0
    help_aim = 0.0
    if direction == 0.0 or direction != sign:
        s[PHASE] = NOTHING
        s[LEVEL] = approach(s[LEVEL], 0.0, leave)
    elif s[PHASE] == NOTHING:
        wanted = p[BREAK_POSITIVE] if sign > 0.0 else p[BREAK_NEGATIVE]
        if s[QUIET] <= QUIET_TIME:
            s[PHASE] = MOVING
        elif sign * s[LEVEL] < 0.05 * wanted:
            begin_probe(s, sign, wanted)
        else:
            # Announced again before the level was gone.
            s[LEVEL] = approach(s[LEVEL], 0.0, step)
    elif s[PHASE] == PROBING or s[PHASE] == BACKING:
        probe(p, s, sign)
    elif s[PHASE] == READY:
        help_aim = push_help(p, s, sign)
    elif s[PHASE] == MOVING:
        moving_level(p, s, sign, step)
    else:
        s[LEVEL] = approach(s[LEVEL], 0.0, leave)
        if sign * s[SPEED] > p[BACK_SPEED]:
            s[PHASE] = MOVING
        elif s[QUIET] > NEW_REST_TIME:
            s[PHASE] = NOTHING
    # Earned at once, lost slowly.
    s[HELP] = max(help_aim, s[HELP] - (step if help_aim >= 0.0 else ONSET * step))
    s[KINETIC_SHARE] = 0.0 if s[PHASE] in (PROBING, BACKING) else approach(
        s[KINETIC_SHARE], 1.0, s[STEP] / BLEND_TIME)
    level = sign * s[LEVEL]
    return sign, max(0.0, level + s[HELP]) if level > 0.0 else 0.0


@njit(cache=True)
def creep_excess(p, s, current, friction_effects):
    """Return what has to be taken off friction effects near standstill, in A.

    An effect that was fitted to slow motion may turn over within a few mrad/s, more steeply than
    velocity can be known, and adds to a kinetic term that is already nearly all of friction. So it
    comes in no more steeply than the sigmoid, and at creep the sum stays below the breakaway level
    in use, as if the gain held for all friction current there.
    """
    if friction_effects == 0.0:
        return 0.0
    speed = abs(s[SPEED])
    softened = friction_effects * math.tanh(0.5 * p[STEEPNESS] * speed)
    fade = math.exp(-(speed / CREEP_SPEED) ** 2)
    away = 1.0 if current > 0.0 else -1.0
    bound = p[BREAK_POSITIVE] if away > 0.0 else p[BREAK_NEGATIVE]
    over = away * (current + softened) - bound
    if over > 0.0 and away * softened > 0.0:
        softened -= away * min(over, away * softened) * fade
    return softened - friction_effects


@njit(cache=True)
def continuous_current(p, s, direction, friction_effects):
    """Return the current of the continuous law in A, to which further effects are added.

    In the direction d, from standstill to full speed,

    ``i = L + (P(ω) - L)·tanh(c2·ω/2)``

    with the level L of the breakaway term and P the plateau of Eq. 6 with its viscous part: L at
    rest, Eq. 6 centred at standstill as soon as the joint moves, never less than L in between and,
    below full speed, a little less than sliding friction.
    """
    sign, level = turn_level(p, s, direction)
    speed = s[SPEED]
    along = speed * sign
    plateau = p[UPPER] if speed > 0.0 else p[LOWER]
    # How far the level is from having any say.
    largest = max(p[BREAK_POSITIVE], p[BREAK_NEGATIVE])
    free = max(0.0, 1.0 - 4.0 * level / largest) if largest > 0.0 else 1.0
    # Against the direction the law turns over slowly: the recoil of a joint that sticks, a few
    # counts, is no movement.
    steep = p[STEEPNESS]
    if along < 0.0:
        steep = free * steep + (1.0 - free) * min(steep, 2.0 / p[BACK_SPEED])
    moving = math.tanh(0.5 * steep * abs(speed))
    kinetic = s[KINETIC_SHARE] * (p[VISCOUS] * speed + plateau * moving)
    # Without a direction the joint is meant to come to rest where it is left: near standstill a
    # share of its friction stays.
    kinetic *= 1.0 - REST_SHARE * free * math.exp(-(speed / REST_SPEED) ** 2)
    if along >= 0.0:
        # What the moving joint needs is paid once: by the kinetic term or by the level.
        share = 1.0 - s[KINETIC_SHARE] * moving
        level = max(0.0, level - max(0.0, sign * friction_effects))
        # Breakaway may exceed sliding friction by far: then friction falls as the speed rises.
        sliding = CREEP_SHARE * sign * plateau
        wanted = p[BREAK_POSITIVE] if sign > 0.0 else p[BREAK_NEGATIVE]
        bound = max(sign * kinetic, sliding + max(0.0, wanted - sliding) * (1.0 - moving))
        over = sign * kinetic + share * level - bound
        if over > 0.0:
            share -= smooth(1.5 * moving - 0.5) * over / level
    else:
        share = 1.0 - smooth(-along / p[BACK_SPEED])
    breakaway = sign * share * level
    s[KINETIC_TERM] = kinetic
    s[BREAKAWAY_TERM] = breakaway
    return kinetic + breakaway + creep_excess(p, s, kinetic + breakaway, friction_effects)
