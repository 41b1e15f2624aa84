"""Cloth along a motion, frame after frame: it falls where it is coarse, and settles where it is fine."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from garmentc.passes.anchored_cloth import AnchoredCloth
from garmentc.passes.anchors import Anchors
from garmentc.passes.body_contacts import Planes
from garmentc.passes.cloth_dynamics import ClothDynamics, MovingCloth, advanced
from garmentc.passes.posed_skinning import PosedVertices, posed_outfit
from garmentc.rig import Rig
from garmentc.smpl.motion import Motion
from garmentc.smpl.rotations import axis_angle_to_matrix, axis_angle_to_quaternion, quaternion_to_axis_angle, slerp
from garmentc.smpl.skeleton import JOINT_COUNT

_Floats = NDArray[np.float32]

_FRAMES_AT_ONCE = 64

_SLOWEST = 24.0
"""Frames a second: between those of slower motions there is too much way, and others are put in."""

_POSES_ALONE = 6.0
"""Frames a second: those of even slower motions are poses, each of them by itself."""

_WAY_IN, _PAUSE = 1.0, 0.25
"""Seconds in which the body comes from its pose at rest to the first one, and stays there, before anything is shown."""

_MOST_AT_REST = 6000
"""Rounds: more for edges so short that a second would take more."""

_FASTEST = 15.0
"""m/s: where a whole outfit goes faster from one frame to the next, the motion has been cut there."""


@dataclass(frozen=True)
class Falling:
    """How cloth moves as a body of its own.

    anchors   vertices that do, at most
    apart     metres between them, at least: closer ones would need more rounds to be as stiff
    memory    seconds after which cloth goes back to where the pose alone would have it, to 1/e: what has slid off comes
              back
    stays     metres that cloth sags in a second at rest until it has found its place; what goes twice as far is falling
              off, and something must hold it
    first     rounds of falling at rest, the body still, before anything is shown,
    touching  in which it is asked so often what the cloth touches
    """

    anchors: int = 4000
    apart: float = 0.02
    dynamics: ClothDynamics = field(default_factory=ClothDynamics)
    memory: float = 4.0
    stays: float = 0.05
    first: int = 240
    touching: int = 6


@dataclass(frozen=True)
class Settling:
    """How the cloth between goes back to its lengths and out of the skin, where there is any.

    anchors               vertices that do, at most
    rounds                of that in a frame
    relaxation, momentum  as in `ResolveCollisions`
    smoothing             how far the movement of vertices is brought to that of their neighbours; keeps cloth from
                          crumpling, and makes fewer shapes do
    """

    anchors: int = 10_000
    rounds: int = 10
    relaxation: float = 1.2
    momentum: float = 0.8
    smoothing: float = 0.2


@dataclass(frozen=True)
class AnimatedCloth:
    """n anchors of an outfit, of which some fall and the others go with them.

    falls     those that fall, and how firmly the skin holds them, (m, 1)
    settles   all n, or None where they are the same
    yielding  (n, 1) 0 where the skin holds the cloth
    carried   sparse (n, m) what takes movements of those that fall to all
    """

    falls: AnchoredCloth
    firmness: _Floats
    settles: AnchoredCloth | None
    yielding: _Floats
    carried: Any
    falling: Falling
    settling: Settling

    @classmethod
    def of(
        cls,
        rig: Rig,
        anchors: Anchors,
        anchored: Callable[[Anchors], AnchoredCloth],
        firmness: NDArray[Any],
        falling: Falling,
        settling: Settling,
    ) -> AnimatedCloth:
        """The `anchors` of `rig`, made cloth by `anchored`; `firmness` (N,) of all its vertices."""
        from scipy.sparse import vstack

        settles = anchored(anchors)
        closeness = float(settles.springs.lengths.mean()) / falling.apart
        count = min(falling.anchors, round(len(anchors.rows) * min(1.0, closeness**2)))
        yielding = 1 - firmness[anchors.rows, None]
        if count >= len(anchors.rows):
            return cls(settles, _held(settles, 1 - yielding, falling), None, yielding, None, falling, settling)
        coarse = Anchors.of(rig, max(1, count))
        carried = vstack([block for _, block in coarse.interpolators(rig.vertex_count)], "csr")[anchors.rows]
        falls = anchored(coarse)
        held = _held(falls, firmness[coarse.rows, None], falling)
        return cls(falls, held, settles, yielding, carried, falling, settling)

    def along(self, motion: Motion) -> Iterator[_Floats]:
        """Where the anchors are in each frame of `motion`, (3, n), without its translation."""
        between = 1
        if _POSES_ALONE <= motion.fps < _SLOWEST and len(motion) > 1:
            between = int(np.ceil(_SLOWEST / motion.fps))
            motion = motion.resampled(between * motion.fps)
        whole = with_way_in(motion)
        begin = len(whole) - len(motion)
        for frame, way in self._fall(whole):
            if frame >= begin and (frame - begin) % between == 0:
                yield self._settle(whole.poses[frame : frame + 1], way)

    def _fall(self, motion: Motion) -> Iterator[tuple[int, _Floats]]:
        """Each frame, and how far what falls has gone there from where the pose alone would have it; (3, m, 1)."""
        last: _Frame | None = None
        for begin in range(0, len(motion), _FRAMES_AT_ONCE):
            poses = motion.poses[begin : begin + _FRAMES_AT_ONCE]
            posed, skin = posed_outfit(self.falls.part, poses), self.falls.skin.planes(poses)
            for number in range(len(poses)):
                frame, now = begin + number, posed.pose(number)
                gone = motion.trans[frame] - motion.trans[frame - 1]
                if last is not None:
                    last = last.seen_from(gone)
                    if last.is_cut_from(now.vertices, 1 / motion.fps):
                        last = None
                if last is None:
                    cloth = self._begun(poses[number : number + 1], _to_next(motion, frame), 1 / motion.fps)
                else:
                    cloth = self._advanced(last, now.vertices, skin.pose(number), gone, 1 / motion.fps)
                last = _Frame(cloth, now.vertices, skin.pose(number))
                yield frame, now.at_rest(cloth.vertices - now.vertices)

    def _begun(self, pose: NDArray[Any], ahead: NDArray[Any], seconds: float) -> MovingCloth:
        """The cloth in `pose` (1, 24, 3), with the speed of a body that goes `ahead` (3,) metres in so many seconds."""
        falling = self.falling
        start = self.falls.fallen(pose, self.firmness[:, 0], falling.dynamics, falling.first, falling.touching)
        step = ahead / falling.dynamics.rounds(self.falls.springs, seconds)
        return MovingCloth(start, np.broadcast_to(step.astype(np.float32)[:, None, None], start.shape))

    def _advanced(self, last: _Frame, posed: _Floats, skin: Planes, gone: NDArray[Any], seconds: float) -> MovingCloth:
        """The cloth a frame later: the pose alone would have it at `posed` (3, m, 1), and the body has `gone` (3,)."""
        dynamics, springs = self.falling.dynamics, self.falls.springs
        path = self.falls.path(last.cloth.vertices, last.skin, skin)
        held = self.firmness, last.posed, posed
        borne = self.falls.borne(last.cloth.vertices, path, self.firmness[:, 0])
        rounds = dynamics.rounds(springs, seconds)
        cloth = advanced(last.cloth, springs, self.falls.overlaps, path, held, borne, dynamics, seconds, rounds, gone)
        forgotten = np.float32(-np.expm1(-seconds / self.falling.memory))
        return MovingCloth(cloth.vertices + forgotten * (posed - cloth.vertices), cloth.step)

    def _settle(self, pose: NDArray[Any], moved: _Floats) -> _Floats:
        """Where all anchors are (3, n) in `pose` (1, 24, 3) when those that fall have `moved` (3, m, 1) at rest."""
        cloth = self.falls if self.settles is None else self.settles
        now = posed_outfit(cloth.part, pose)
        way = moved if self.settles is None else (self.carried @ moved[:, :, 0].T).T[:, :, None]
        vertices = now.vertices + now.turned(way)
        contact = cloth.touching(PosedVertices(vertices, now.turn), cloth.skin.planes(pose))
        if self.settles is not None:
            relaxation, momentum = self.settling.relaxation * self.yielding, self.settling.momentum
            vertices = contact.settled(vertices, cloth.springs, self.settling.rounds, relaxation, momentum)
            vertices += self.settling.smoothing * cloth.springs.roughness(vertices - now.vertices)
        # The skin that was nearest when the frame began may not be any more.
        vertices += contact.way_out(vertices)
        result: _Floats = vertices[:, :, 0]
        return result


def _held(cloth: AnchoredCloth, firmness: _Floats, falling: Falling) -> _Floats:
    """Firmness (m, 1), with what something else holds that nobody has told of: buttons, straps, elastic.

    An outfit hangs at rest as its author has it. What falls off a body that just stands there must be held.
    """
    rest, second = np.zeros((1, JOINT_COUNT, 3)), round(1 / falling.dynamics.round_time(cloth.springs))
    rounds = min(second, _MOST_AT_REST)
    fallen = cloth.fallen(rest, firmness[:, 0], falling.dynamics, rounds, 30)
    way = np.linalg.norm(fallen[:, :, 0] - cloth.part.template.T, axis=0)[:, None]
    falls_off = np.clip(way / falling.stays - 1, 0, 1)
    held: _Floats = np.maximum(firmness, falls_off).astype(np.float32)
    return held


def with_way_in(motion: Motion) -> Motion:
    """The motion after a way in from the pose at rest, in its first heading and at its first speed.

    Cloth must not begin with a jump. Poses by themselves get none.
    """
    if motion.fps < _POSES_ALONE:
        return motion
    count, pause = round(_WAY_IN * motion.fps), round(_PAUSE * motion.fps)
    share = np.concatenate([np.arange(count) / count, np.ones(pause)])
    share = share * share * (3 - 2 * share)  # no speed at either end
    first = np.asarray(motion.poses[0], np.float64)
    root = axis_angle_to_matrix(first[0])
    rest = np.zeros_like(first)
    rest[0, 1] = np.arctan2(root[0, 2], root[2, 2])
    start, end = (
        np.broadcast_to(axis_angle_to_quaternion(pose), (len(share), len(first), 4)) for pose in (rest, first)
    )
    poses = quaternion_to_axis_angle(slerp(start, end, np.broadcast_to(share[:, None], start.shape[:2])))
    step = _to_next(motion, 0)
    trans = motion.trans[0] + np.arange(-len(share), 0)[:, None] * step
    return replace(motion, poses=np.concatenate([poses, motion.poses]), trans=np.concatenate([trans, motion.trans]))


def _to_next(motion: Motion, frame: int) -> NDArray[np.float64]:
    """Metres (3,) from one frame to the next; none from the last, and where the motion is cut."""
    way = np.asarray(motion.trans[min(frame + 1, len(motion) - 1)] - motion.trans[frame], np.float64)
    return way if np.linalg.norm(way) <= _FASTEST / motion.fps else np.zeros(3)


@dataclass(frozen=True)
class _Frame:
    """The cloth in a frame, where its pose alone would have it (3, m, 1), and the skin."""

    cloth: MovingCloth
    posed: _Floats
    skin: Planes

    def seen_from(self, ahead: NDArray[Any]) -> _Frame:
        """The same in the axes of a body that has gone `ahead` (3,) metres since."""
        back = -ahead.astype(np.float32)[:, None, None]
        cloth = MovingCloth(self.cloth.vertices + back, self.cloth.step)
        return _Frame(cloth, self.posed + back, Planes(self.skin.centers + back, self.skin.normals))

    def is_cut_from(self, posed: _Floats, seconds: float) -> bool:
        """Whether a frame so much later, where the pose alone would have the cloth at `posed`, does not follow."""
        way = float(np.linalg.norm((posed - self.posed).mean(axis=1)))
        return seconds > 1 / _POSES_ALONE or way > _FASTEST * seconds
