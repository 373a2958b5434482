"""Keyframes taken out of a graph, which keeps what their factors said of the others.

The information that the factors of a keyframe leave on its neighbours when it is eliminated relates all of these to
each other. Between factors along the tree of the most certain pairs stand for it (Carlevaris-Bianco et al., "Generic
Node Removal for Factor-Graph SLAM", T-RO 2014), so that the graph stays sparse. They say what the estimate says.
"""

from collections import defaultdict
from collections.abc import Collection, Iterable, Mapping, Sequence
from heapq import heapify, heappop, heappush

import numpy as np

from wayfi.backend.graph.factors import BetweenFactor, Factor, NearFactor
from wayfi.backend.pose2 import Floats, Pose2, adjoint, covariance_in_b

ENOUGH = 4  # factors of a keyframe: a map that is driven again and again keeps its size, and costs what it did
LOOSE_INFORMATION = 1e-6  # of 1 km and 1,000 rad: the equations can be solved where factors leave a direction open


class Marginalisation:
    """The `factors` of a graph at `poses` (n, 3), by their numbers, from which keyframes are taken.

    Those in `kept` are never merged with others between the same keyframes.
    """

    def __init__(self, factors: Mapping[int, Factor], poses: Floats, kept: Collection[int]) -> None:
        self.factors = dict(factors)
        self._poses, self._kept = poses, frozenset(kept)
        self._next = max(self.factors, default=-1) + 1
        self._of_keyframe: dict[int, set[int]] = defaultdict(set)
        for number, factor in self.factors.items():
            self._of_keyframe[factor.a].add(number)
            self._of_keyframe[factor.b].add(number)

    def remove_all(self, keyframes: Iterable[int]) -> None:
        """Take keyframes out, those with the fewest neighbours first, which keeps all that is to be solved small.

        Of all factors that may be merged, the least certain go then where both keyframes have more than ENOUGH: those
        of earlier days that relate far places are what makes a graph dense.
        """
        queue = [(self._degree(keyframe), keyframe) for keyframe in keyframes]
        heapify(queue)
        while queue:
            degree, keyframe = heappop(queue)
            if degree < (now := self._degree(keyframe)):
                heappush(queue, (now, keyframe))
            else:
                self._remove(keyframe)
        self._thin()

    def _thin(self) -> None:
        left = [(f, n) for n, f in self.factors.items() if isinstance(f, BetweenFactor) and n not in self._kept]
        for factor, number in sorted(left, key=lambda each: (-_log_volume(each[0]), each[1])):
            if min(self._degree(factor.a), self._degree(factor.b)) > ENOUGH:
                self._take(number)

    def _degree(self, keyframe: int) -> int:
        return len(self._of_keyframe[keyframe])

    def _remove(self, keyframe: int) -> None:
        """Take a keyframe out; what its factors say of its heading alone, by the building's axes, goes with it."""
        own = [self._take(number) for number in sorted(self._of_keyframe[keyframe])]
        del self._of_keyframe[keyframe]
        related = [factor for factor in own if isinstance(factor, BetweenFactor | NearFactor)]
        neighbours = sorted({k for factor in related for k in (factor.a, factor.b)} - {keyframe})
        if len(neighbours) > 1:
            information = _eliminated(related, [keyframe, *neighbours], self._poses)
            for factor in _tree(information, neighbours, self._poses):
                self._add(factor)

    def _take(self, number: int) -> Factor:
        factor = self.factors.pop(number)
        self._of_keyframe[factor.a].discard(number)
        self._of_keyframe[factor.b].discard(number)
        return factor

    def _add(self, factor: BetweenFactor) -> None:
        """Add a factor, merged with one between the same keyframes if there is one."""
        for number in sorted(self._of_keyframe[factor.a] & self._of_keyframe[factor.b] - self._kept):
            other = self.factors[number]
            if isinstance(other, BetweenFactor) and (other.a, other.b) == (factor.a, factor.b):
                factor = _merged(other, factor)
                self._take(number)
        self.factors[self._next] = factor
        self._of_keyframe[factor.a].add(self._next)
        self._of_keyframe[factor.b].add(self._next)
        self._next += 1


def _eliminated(factors: Sequence[BetweenFactor | NearFactor], keyframes: Sequence[int], poses: Floats) -> Floats:
    """(3 m, 3 m) information of the factors on the last m of the keyframes, the first one eliminated.

    It is in the tangent space of each keyframe.
    """
    place = {keyframe: 3 * i for i, keyframe in enumerate(keyframes)}
    information = np.zeros((3 * len(keyframes), 3 * len(keyframes)))
    for factor in factors:
        J_a, J_b, own = _linearised(factor, Pose2.of(poses[factor.a]), Pose2.of(poses[factor.b]))
        a, b = slice(place[factor.a], place[factor.a] + 3), slice(place[factor.b], place[factor.b] + 3)
        information[a, a] += J_a.T @ own @ J_a
        information[b, b] += J_b.T @ own @ J_b
        information[a, b] += J_a.T @ own @ J_b
        information[b, a] += J_b.T @ own @ J_a
    first = information[:3, :3] + LOOSE_INFORMATION * np.eye(3)
    left: Floats = information[3:, 3:] - information[3:, :3] @ np.linalg.solve(first, information[:3, 3:])
    return left


def _linearised(factor: BetweenFactor | NearFactor, T_map_a: Pose2, T_map_b: Pose2) -> tuple[Floats, Floats, Floats]:
    """The derivatives of a factor's error by the tangents of its keyframes, and its information."""
    if isinstance(factor, NearFactor):
        J_a, J_b = _position_derivative(T_map_a, factor.place_a), _position_derivative(T_map_b, factor.place_b)
        return -J_a, J_b, np.eye(2) * float(factor.sigma_m**-2)
    J_a = -adjoint(T_map_b.between(T_map_a))
    return J_a, np.eye(3), np.asarray(np.linalg.inv(covariance_in_b(factor.covariance, factor.T_a_b.theta)), np.float64)


def _position_derivative(T: Pose2, place: Floats) -> Floats:
    """(2, 3) derivative of the position in `map` of a place in a keyframe at T by the keyframe's tangent."""
    x, y = Pose2(0.0, 0.0, T.theta).transform(np.array([[-place[1], place[0]]]))[0]
    R = Pose2(0.0, 0.0, T.theta).transform(np.eye(2)).T
    return np.column_stack([R, [x, y]])


def _tree(information: Floats, keyframes: Sequence[int], poses: Floats) -> list[BetweenFactor]:
    """Between factors along the tree of the most certain relative poses of keyframes with this joint information."""
    open_part = information[3:, 3:] + LOOSE_INFORMATION * np.eye(len(information) - 3)
    covariance = np.zeros_like(information)  # in the frame of the first keyframe
    covariance[3:, 3:] = np.linalg.inv(0.5 * (open_part + open_part.T))
    pairs = [
        (_relative(covariance, i, j, keyframes, poses), i, j)
        for i in range(len(keyframes))
        for j in range(i + 1, len(keyframes))
    ]
    pairs.sort(key=lambda pair: (float(np.linalg.slogdet(pair[0])[1]), pair[1], pair[2]))
    group = list(range(len(keyframes)))
    tree = []
    for relative, i, j in pairs:
        if group[i] != group[j]:
            group = [group[i] if g == group[j] else g for g in group]
            T = Pose2.of(poses[keyframes[i]]).between(Pose2.of(poses[keyframes[j]]))
            tree.append(BetweenFactor(keyframes[i], keyframes[j], T, covariance_in_b(relative, -T.theta)))
    return tree


def _relative(covariance: Floats, i: int, j: int, keyframes: Sequence[int], poses: Floats) -> Floats:
    """(3, 3) covariance of the pose of the j-th keyframe in the i-th, in the tangent space of the j-th."""
    J = np.zeros((3, len(covariance)))
    J[:, 3 * i : 3 * i + 3] = -adjoint(Pose2.of(poses[keyframes[j]]).between(Pose2.of(poses[keyframes[i]])))
    J[:, 3 * j : 3 * j + 3] = np.eye(3)
    relative = J @ covariance @ J.T
    return 0.5 * (relative + relative.T)


def _log_volume(factor: BetweenFactor) -> float:
    """How uncertain the pose of a between factor is."""
    return float(np.linalg.slogdet(factor.covariance)[1])


def _merged(one: BetweenFactor, other: BetweenFactor) -> BetweenFactor:
    """One factor that says what two between the same keyframes say."""
    known, added = np.linalg.inv(one.covariance), np.linalg.inv(other.covariance)
    covariance = np.linalg.inv(known + added)
    pose = Pose2.of(one.T_a_b.array() + covariance @ added @ one.T_a_b.error_of(other.T_a_b))
    return BetweenFactor(one.a, one.b, pose, 0.5 * (covariance + covariance.T))
