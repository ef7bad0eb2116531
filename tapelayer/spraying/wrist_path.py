"""Wrist path: the wrist's angles along a pass, and where the pass must be split."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from tapelayer.arrays import Floats, Frozen, Ints, Mask
from tapelayer.machines.wrist import ROUNDING, Wrist, angles_between, gun_axes, turns
from tapelayer.spraying.passes import Reason

# Cell widths of the search over theta: the narrow ones are tried where the wide ones would split the pass. Theta is
# not rounded within its cell.
_CELLS = (math.radians(1.0), math.radians(0.25))

# The search samples points between which theta can turn by this many cells, at most this far apart (metres).
_STRIDE = 4
_FURTHEST = 0.005

# Smallest share of the gun's speed at which theta and phi may follow; where they cannot follow at all, the pass splits.
_SLOWEST = 0.5

# Largest step of an axis between two points, however long it may take: the axes move evenly from point to point, and
# during a longer step the gun would lean more than at either end.
_STEP = math.radians(30.0)

# Weight of the time of turns with the arc off: small, so that it only decides between otherwise equal paths.
_IDLE = 1e-3


@dataclass(frozen=True, eq=False)
class Followed(Frozen):
    """The wrist's path over a pass, in pieces with the arc on throughout.

    Piece k has the rows from starts[k] to before starts[k + 1], the last piece to the end.

    Attributes:
        points: (m,) index of each row's point of the pass, not decreasing; a piece starts on the point where the last
            one ended, or on the next point if no pose serves both.
        theta: (m,) radians.
        phi: (m,) radians.
        starts: (p,) first row of each piece.
        reasons: p - 1 reasons, one per split.
    """

    points: Ints
    theta: Floats
    phi: Floats
    starts: Ints
    reasons: tuple[Reason, ...]


def follow(wrist: Wrist, normals: Floats, arc_lengths: Floats, leans: Floats, theta_before: float) -> Followed:
    """Return the wrist's path along one pass: inside its travel, with the fewest splits and then the least motion.

    At every point the gun leans no more than permitted, and from point to point of a piece no axis turns by more than
    30 deg, nor further than it can while the gun moves at half its speed.

    Theta results from dynamic programming over cells of its travel. Of the paths with the fewest splits, the one with
    the least integral over time of (theta's speed / its limit)^2 + (lean / max_deviation)^2 is chosen: the gun stays
    close to the normal where that needs little turning, and theta passes the pole calmly. Phi then follows the normal
    as closely as its speed allows; where that is not close enough, the pass splits too.

    Args:
        wrist: its travel, speeds and limits.
        normals: (n, 3) unit normals out of the surface along the pass, in `machine`.
        arc_lengths: (n,) metres along the pass, not decreasing.
        leans: (n,) largest lean off each normal, radians, at most `max_deviation`; inf near a crease, where the gun
            may swing through.
        theta_before: theta at which the gun arrives, radians; it only decides between otherwise equal paths.

    Raises:
        ValueError: a point is not `reachable`, or the rows do not match.
    """
    count = len(normals)
    if not (normals.shape == (count, 3) and arc_lengths.shape == leans.shape == (count,) and count):
        raise ValueError(
            f"{normals.shape} normals, {arc_lengths.shape} arc lengths and {leans.shape} leans do not match"
        )
    route = _Route(wrist, normals, arc_lengths, leans)
    pieces, first, before = [], 0, theta_before
    while first < count:
        more, first = route.pieces(first, before)
        pieces += more
        before = float(pieces[-1].theta[-1])
    reasons = tuple(_reason(route, one, two) for one, two in zip(pieces[:-1], pieces[1:], strict=True))
    sizes = [len(piece.theta) for piece in pieces]
    return Followed(
        points=np.concatenate([np.arange(piece.first, piece.first + len(piece.theta)) for piece in pieces]),
        theta=np.concatenate([piece.theta for piece in pieces]),
        phi=np.concatenate([piece.phi for piece in pieces]),
        starts=np.cumsum([0, *sizes[:-1]]),
        reasons=reasons,
    )


@dataclass(frozen=True, eq=False)
class _PassPlan:
    """Theta (m,) in radians at the m stations of a piece from the point `first` to `last`, both included."""

    first: int
    last: int
    stations: Ints
    theta: Floats


@dataclass(frozen=True, eq=False)
class _RoutePiece:
    """Angles (m,) in radians at m consecutive points, starting at the point `first`."""

    first: int
    theta: Floats
    phi: Floats


@dataclass(frozen=True, eq=False)
class _States(Frozen):
    """The best theta in each of k cells at n points, with its lean and the range of phi that serves, (n, k)."""

    theta: Floats
    lean: Floats
    phi_lower: Floats
    phi_upper: Floats
    open: Mask

    @staticmethod
    def of(wrist: Wrist, normals: Floats, leans: Floats, cell: float) -> _States:
        """Return the states of normals (n, 3) with permitted leans (n,), in cells at most `cell` radians wide."""
        travel = wrist.theta.upper - wrist.theta.lower
        edges = np.linspace(wrist.theta.lower, wrist.theta.upper, math.ceil(travel / cell) + 1)
        azimuth = np.arctan2(normals[:, 1], normals[:, 0])[:, None]
        # Theta follows the normal once per turn, and once per half turn if phi may be negative.
        period = 2 * np.pi if wrist.tilts[0] >= 0 else np.pi
        middles = 0.5 * (edges[:-1] + edges[1:])
        nearest = azimuth + period * np.round((middles - azimuth) / period)
        theta = np.clip(nearest, edges[:-1], edges[1:])
        best, lower, upper = phi_bounds(wrist, normals[:, None, :], theta, leans[:, None])
        lean = angles_between(gun_axes(theta, best), normals[:, None, :])
        # Twice the rounding, so that every `reachable` point has a state.
        return _States(theta, lean, lower, upper, (lean <= leans[:, None] + 2 * ROUNDING) & (normals[:, 2:] > 0))


class _Route:
    """A pass with its limits, prepared for the search for pieces."""

    def __init__(self, wrist: Wrist, normals: Floats, arc_lengths: Floats, leans: Floats) -> None:
        self.wrist, self.normals, self.arc_lengths, self.leans = wrist, normals, arc_lengths, leans
        # How far the axes can have turned at each point since the pass began, with the gun as slow as permitted.
        seconds = np.diff(arc_lengths, prepend=arc_lengths[:1]) / (_SLOWEST * wrist.gun_speed)
        self.theta_turned = np.cumsum(np.minimum(wrist.theta.speed * seconds, _STEP))
        self.phi_turned = np.cumsum(np.minimum(wrist.phi.speed * seconds, _STEP))

    def between(self, first: int, last: int, wrist: Wrist) -> _Route:
        """Return the part from one point to another, both included, for another wrist."""
        rows = np.s_[first : last + 1]
        return _Route(wrist, self.normals[rows], self.arc_lengths[rows], self.leans[rows])

    def pieces(self, first: int, theta_before: float) -> tuple[list[_RoutePiece], int]:
        """Return the pieces of the best path from the point `first` on, and the point to continue from (n if done)."""
        for cell in _CELLS:
            pieces: list[_RoutePiece] = []
            following = len(self.normals)
            for plan in self._plans(first, theta_before, cell):
                piece = self._piece(plan)
                if len(piece.theta):
                    pieces.append(piece)
                reached = plan.first + len(piece.theta)
                if reached <= plan.last:
                    following = reached
                    break
            if len(pieces) == 1 and following == len(self.normals):
                break
        return pieces, following

    def _piece(self, plan: _PassPlan) -> _RoutePiece:
        """Return the path of a plan at every point, up to the first point that it cannot pass."""
        first = plan.first
        rows = np.arange(first, plan.last + 1)
        target = np.interp(self.arc_lengths[rows], self.arc_lengths[plan.stations], plan.theta)
        target[plan.stations - first] = plan.theta

        lower, upper = self._theta_bounds(rows, target)
        # A planned state keeps its lean, but rounding may put it outside the bounds.
        planned = plan.stations - first
        lower[planned] = np.minimum(lower[planned], plan.theta)
        upper[planned] = np.maximum(upper[planned], plan.theta)
        length = self._passable(first, lower, upper, self.theta_turned[rows])
        rows = rows[:length]
        theta = _within(target[:length], lower[:length], upper[:length], self.theta_turned[rows])

        best, lower, upper = phi_bounds(self.wrist, self.normals[rows], theta, self.leans[rows])
        length = self._passable(first, lower, upper, self.phi_turned[rows])
        phi = _within(best[:length], lower[:length], upper[:length], self.phi_turned[rows[:length]])
        return _RoutePiece(first, theta[:length], phi)

    def _stations(self, first: int, cell: float) -> Ints:
        """Return the points from `first` on that the search samples; the points between them follow."""
        turning = _STRIDE * cell * _SLOWEST * self.wrist.gun_speed / self.wrist.theta.speed
        along = self.arc_lengths[first:]
        stations, reached = [0], 0
        while True:
            reached = int(np.searchsorted(along, along[reached] + min(turning, _FURTHEST)))
            if reached >= len(along):
                return first + np.array(stations)
            stations.append(reached)

    def _plans(self, first: int, theta_before: float, cell: float) -> list[_PassPlan]:
        """Return the pieces of the best path at the stations, by dynamic programming over the states."""
        wrist, stations = self.wrist, self._stations(first, cell)
        states = _States.of(wrist, self.normals[stations], self.leans[stations], cell)
        lost = np.flatnonzero(~np.any(states.open, axis=1))
        if len(lost):
            point = stations[lost[0]]
            raise ValueError(f"point {point}: the wrist cannot reach the normal {self.normals[point]}")
        seconds = np.diff(self.arc_lengths[stations]) / wrist.gun_speed
        shares = 0.5 * (np.append(seconds, 0.0) + np.insert(seconds, 0, 0.0))
        leaning = np.where(states.open, shares[:, None] * (states.lean / wrist.max_deviation) ** 2, np.inf)
        # A split costs more than all turns (at most 4 a second), leans and gaps of a path without it.
        split = 1.0 + (15.0 + (math.pi / wrist.max_deviation) ** 2) * float(np.sum(seconds))

        came = np.zeros(states.theta.shape, dtype=np.int64)
        # Where a piece starts in this cell, the cell in which the previous piece ended; elsewhere -1.
        left = np.full(states.theta.shape, -1, dtype=np.int64)
        gap = np.zeros(states.theta.shape, dtype=np.bool_)
        step = _Step(self, stations, states, cell)
        cost = leaning[0] + self._idle(states.theta[0], theta_before)
        for row in range(1, len(stations)):
            moved, came[row] = step.least(row, cost)
            best = int(np.argmin(cost))
            # Splitting in place beats splitting across an unsprayed gap.
            dear = split + 10.0 * seconds[row - 1]
            anew = cost[best] + dear + self._idle(states.theta[row], states.theta[row - 1, best])
            gap[row] = ~(moved <= anew)
            left[row, gap[row]] = best
            cost = np.where(gap[row], anew, moved) + leaning[row]
            best = int(np.argmin(cost))
            anew = cost[best] + split + self._idle(states.theta[row], states.theta[row, best])
            turned = states.open[row] & ~(cost <= anew)
            gap[row, turned] = False
            left[row, turned] = best
            cost = np.where(turned, anew, cost)
        return self._traced(stations, states.theta, (came, left, gap), int(np.argmin(cost)))

    def _idle(self, theta: Floats, before: float) -> Floats:
        """Return the cost (k,) of turning from `before` to `theta` (k,) with the arc off, both in radians."""
        seconds: Floats = np.abs(theta - before) / self.wrist.theta.speed
        return _IDLE * seconds

    def _traced(self, stations: Ints, theta: Floats, moves: tuple[Ints, Ints, Mask], cell: int) -> list[_PassPlan]:
        """Return the pieces of a path, traced back from its last cell."""
        came, left, gap = moves
        plans: list[_PassPlan] = []
        path = np.empty(len(stations))
        row = end = len(stations) - 1
        last = len(self.normals) - 1
        while True:
            path[row] = theta[row, cell]
            before, over_gap = int(left[row, cell]), bool(gap[row, cell])
            if before < 0 and row > 0:
                cell = int(came[row, cell])
                row -= 1
                continue
            first = self._sharpest(int(stations[row - 1]), int(stations[row])) if over_gap else int(stations[row])
            plans.append(_PassPlan(first, last, stations[row : end + 1], path[row : end + 1].copy()))
            if before < 0:
                return plans[::-1]
            row -= over_gap
            last, end, cell = first - over_gap, row, before

    def _passable(self, first: int, lower: Floats, upper: Floats, turned: Floats) -> int:
        """Return how many points from `first` on a path within bounds (m,) can pass in steps no longer than `turned`'s.

        Where it is blocked at a crease, the path ends at the crease.
        """
        least = np.maximum.accumulate(lower + turned) - turned
        most = turned + np.minimum.accumulate(upper - turned)
        blocked = np.flatnonzero(~(least <= most + ROUNDING))
        if not len(blocked):
            return len(lower)
        end = int(blocked[0])
        # No path joins the points `begin` and `end`.
        begin = min(int(np.argmax((lower + turned)[: end + 1])), int(np.argmin((upper - turned)[: end + 1])))
        if np.any(np.isinf(self.leans[first + begin : first + end + 1])):
            return self._sharpest(first + begin, first + end) - first
        return end

    def _sharpest(self, first: int, last: int) -> int:
        """Return the point after `first`, up to `last`, at which the normal turns most."""
        normals = self.normals[first : last + 1]
        return first + 1 + int(np.argmax(angles_between(normals[:-1], normals[1:])))

    def _theta_bounds(self, rows: Ints, target: Floats) -> tuple[Floats, Floats]:
        """Return both ends (m,) of the range of theta round each target (m,) that has a phi near the normal."""
        azimuth, ahead, behind = turns(self.wrist, self.normals[rows], self.leans[rows])
        centre = azimuth + 2 * np.pi * np.round((target - azimuth) / (2 * np.pi))
        opposite = centre + np.where(target < centre, -np.pi, np.pi)
        off_ahead = np.where(ahead >= 0, np.abs(target - centre) - ahead, np.inf)
        off_behind = np.where(behind >= 0, np.abs(target - opposite) - behind, np.inf)
        forward = np.maximum(off_ahead, 0.0) <= np.maximum(off_behind, 0.0)
        middle, half = np.where(forward, centre, opposite), np.where(forward, ahead, behind)
        whole = (half >= np.pi) | ((ahead >= 0) & (behind >= 0) & (ahead + behind >= np.pi))
        half = np.where(whole, np.inf, half)
        travel = self.wrist.theta
        return np.maximum(middle - half, travel.lower), np.minimum(middle + half, travel.upper)


class _Step:
    """The steps of the search from station to station, with the arc on."""

    def __init__(self, route: _Route, stations: Ints, states: _States, cell: float) -> None:
        self.states, self.cell = states, cell
        self.turned, self.tilted = np.diff(route.theta_turned[stations]), np.diff(route.phi_turned[stations])
        # The square of a turn is divided by the seconds at the gun's speed times the square of theta's top speed.
        self.scales = np.diff(route.arc_lengths[stations]) / route.wrist.gun_speed * route.wrist.theta.speed**2
        cells = states.theta.shape[1]
        # States lie anywhere inside their cells, so a turn can end one cell further than its length; and cells may be
        # a little narrower than `cell`.
        self.wide = min(int(np.max(self.turned, initial=0.0) / cell) + 2, cells - 1)
        self.theta, self.phi_lower, self.phi_upper = (
            sliding_window_view(np.pad(values, ((0, 0), (self.wide, self.wide))), 2 * self.wide + 1, axis=1)
            for values in (states.theta, states.phi_lower, states.phi_upper)
        )
        # Infinite cost beyond the travel, so that no path comes from there.
        self.padded = np.full(cells + 2 * self.wide, np.inf)
        self.costs = sliding_window_view(self.padded, 2 * self.wide + 1)

    def least(self, row: int, cost: Floats) -> tuple[Floats, Ints]:
        """Return the least cost (k,) of reaching each cell of a station, and the cell (k,) before it on that path.

        Args:
            row: the station, 1 or more.
            cost: (k,) cost of reaching each cell of the previous station.
        """
        turned, tilted = self.turned[row - 1], self.tilted[row - 1]
        here, cells = self.states, len(cost)
        self.padded[self.wide : self.wide + cells] = cost
        narrow = min(int(turned / self.cell) + 2, self.wide)
        columns = np.s_[self.wide - narrow : self.wide + narrow + 1]
        turn = here.theta[row][:, None] - self.theta[row - 1][:, columns]
        below = here.phi_lower[row][:, None] - self.phi_upper[row - 1][:, columns]
        above = self.phi_lower[row - 1][:, columns] - here.phi_upper[row][:, None]
        possible = (np.abs(turn) <= turned) & (below <= tilted) & (above <= tilted)
        total = np.where(possible, self.costs[:, columns] + turn**2 / self.scales[row - 1], np.inf)
        best = np.argmin(total, axis=1)
        return total[np.arange(cells), best], np.arange(cells) + best - narrow


def _reason(route: _Route, one: _RoutePiece, two: _RoutePiece) -> Reason:
    """Return why the second piece does not continue the first, by trying a wrist with all tilts and two more turns."""
    wrist = route.wrist
    theta = replace(wrist.theta, lower=wrist.theta.lower - 2 * math.pi, upper=wrist.theta.upper + 2 * math.pi)
    phi = replace(wrist.phi, lower=-math.pi / 2, upper=math.pi / 2)
    last = two.first + len(two.theta) - 1
    free = route.between(one.first, last, replace(wrist, theta=theta, phi=phi))
    pieces, _ = free.pieces(0, float(one.theta[0]))
    return Reason.TRAVEL if len(pieces[0].theta) == last - one.first + 1 else Reason.CREASE


def phi_bounds(wrist: Wrist, normals: Floats, theta: Floats, leans: Floats) -> tuple[Floats, Floats, Floats]:
    """Return for each theta (...) the phi nearest to the normal (..., 3), and the range of phi within the lean (...).

    In the vertical plane of theta the limit is reached where cos(lean) = cos(off) cos(phi - phi nearest), `off` being
    the normal's angle off that plane.
    """
    x, y, z = normals[..., 0], normals[..., 1], normals[..., 2]
    sine, cosine = np.sin(theta), np.cos(theta)
    off = np.arcsin(np.minimum(np.abs(y * cosine - x * sine), 1.0))
    lean = np.minimum(leans, np.pi)
    # 1 - cos(lean) / cos(off), without the rounding of that difference.
    share = np.sin((lean + off) / 2) * np.sin((lean - off) / 2) / np.cos(off)
    slack = 2 * np.arcsin(np.sqrt(np.clip(share, 0.0, 1.0)))
    exact = np.arctan2(x * cosine + y * sine, z)
    best = np.clip(exact, *wrist.tilts)
    # Rounding must not put the best phi outside.
    lower = np.minimum(np.maximum(exact - slack, wrist.tilts[0]), best)
    upper = np.maximum(np.minimum(exact + slack, wrist.tilts[1]), best)
    return best, lower, upper


def _highest_path(values: Floats, turned: Floats) -> Floats:
    """Return the greatest path (n,) below values (n,) with steps no longer than those of `turned`, in radians."""
    after = turned + np.minimum.accumulate(values - turned)
    before = np.minimum.accumulate((values + turned)[::-1])[::-1] - turned
    return np.minimum(after, before)


def _within(target: Floats, lower: Floats, upper: Floats, turned: Floats) -> Floats:
    """Return a path (n,) close to the target within bounds, with steps no longer than those of `turned`, in radians.

    It is the target where that complies; else midway between the least path above it and the greatest path below it.
    """
    target = 0.5 * (_highest_path(target, turned) - _highest_path(-target, turned))
    return np.minimum(np.maximum(target, -_highest_path(-lower, turned)), _highest_path(upper, turned))
