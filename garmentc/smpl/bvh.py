"""Biovision hierarchy (BVH) files: a skeleton and its rotations over time. No body is involved here."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from garmentc.errors import GarmentcError

_AXES = "XYZ"


@dataclass(frozen=True)
class _Joint:
    name: str
    parent: int
    offset: tuple[float, float, float]
    channels: tuple[str, ...]  # "Xrotation", "Yposition", ...; none for an end site


@dataclass(frozen=True)
class BvhClip:
    """A BVH file, evaluated. Axes and length unit are the file's.

    names       K joint names; an end site is called after its joint with "_end"
    rest        (K, 3) joint positions at zero rotation, the root at the origin
    rotations   (T, K, 3, 3) world rotations relative to the zero pose
    positions   (T, K, 3) world positions
    fps         frames a second
    """

    names: tuple[str, ...]
    rest: NDArray[np.float64]
    rotations: NDArray[np.float64]
    positions: NDArray[np.float64]
    fps: float


def read_bvh(path: Path) -> BvhClip:
    """Read and evaluate a BVH file. Raises GarmentcError with the line that is wrong."""
    try:
        text = path.read_bytes().decode("latin-1")
    except OSError as error:
        raise GarmentcError(f"cannot be read: {error.strerror}", path) from None
    lines = text.removeprefix("ï»¿").splitlines()  # a byte order mark, seen as latin-1
    start = next((k for k, line in enumerate(lines) if line.split()[:1] == ["MOTION"]), None)
    if not lines or start is None:
        raise GarmentcError("is not a BVH file: it has no MOTION section", path)
    joints = _read_hierarchy(lines[:start], path)
    frames, fps = _read_motion(lines, start, sum(len(joint.channels) for joint in joints), path)
    return _evaluate(joints, frames, fps)


class _Tokens:
    """The words of the HIERARCHY section, with the line each stands on."""

    def __init__(self, lines: list[str], path: Path) -> None:
        self.path = path
        self.words = [(word, number) for number, line in enumerate(lines, 1) for word in line.split()]
        self.at = 0

    def error(self, message: str) -> GarmentcError:
        """`message`, at the line of the word that was read last."""
        return GarmentcError(message, self.path, self.words[max(self.at - 1, 0)][1] if self.words else 1)

    def next(self, expected: str) -> str:
        if self.at >= len(self.words):
            raise self.error(f"the file ends where {expected} should follow")
        self.at += 1
        return self.words[self.at - 1][0]

    def numbers(self, count: int, what: str) -> list[float]:
        values = []
        for _ in range(count):
            word = self.next(f"a number of {what}")
            value = _number(word)
            if value is None:
                raise self.error(f"'{word[:40]}' is no number; {what} needs {count}")
            values.append(value)
        return values

    def name(self) -> str:
        """Words up to the opening brace: exporters write names with spaces."""
        words = []
        while (word := self.next("an opening brace")) != "{":
            words.append(word)
        return " ".join(words)


def _number(word: str) -> float | None:
    try:
        value = float(word)
    except ValueError:
        return None
    return value if math.isfinite(value) else None


def _read_hierarchy(lines: list[str], path: Path) -> list[_Joint]:
    tokens = _Tokens(lines, path)
    if tokens.next("HIERARCHY") != "HIERARCHY":
        raise tokens.error("is not a BVH file: it does not begin with HIERARCHY")
    names: list[str] = []
    parents: list[int] = []
    offsets: list[list[float]] = []
    channels: list[list[str]] = []
    open_joints: list[int] = []
    while tokens.at < len(tokens.words):
        word = tokens.next("a joint")
        if word in ("ROOT", "JOINT", "End"):
            if (word == "ROOT") != (not names) or (word != "ROOT" and not open_joints):
                raise tokens.error(f"{word} is out of place; one ROOT holds every JOINT and End Site")
            parents.append(open_joints[-1] if open_joints else -1)
            name = tokens.name()
            names.append(f"{names[parents[-1]]}_end" if word == "End" else name)
            offsets.append([])
            channels.append([])
            open_joints.append(len(names) - 1)
        elif word == "OFFSET" and open_joints:
            offsets[open_joints[-1]] = tokens.numbers(3, "OFFSET")
        elif word == "CHANNELS" and open_joints:
            channels[open_joints[-1]] = _read_channels(tokens)
        elif word == "}" and open_joints:
            if not offsets[open_joints.pop()]:
                raise tokens.error("a joint ends without an OFFSET")
        else:
            raise tokens.error(f"unexpected '{word[:40]}' in the HIERARCHY section")
    if open_joints or not names:
        raise tokens.error(f"joint '{names[open_joints[-1]]}' is never closed" if names else "there is no ROOT")
    return [
        _Joint(name, parent, (offset[0], offset[1], offset[2]), tuple(channel))
        for name, parent, offset, channel in zip(names, parents, offsets, channels, strict=True)
    ]


def _read_channels(tokens: _Tokens) -> list[str]:
    count = tokens.next("the number of CHANNELS")
    if not count.isdecimal() or len(count) > 1:
        raise tokens.error(f"CHANNELS needs a count of 0 to 6, not '{count[:40]}'")
    names = [tokens.next("a channel").capitalize() for _ in range(int(count))]
    for name in names:
        if name[:1] not in _AXES or name[1:] not in ("rotation", "position"):
            raise tokens.error(f"unknown channel '{name[:40]}'; expected Xrotation, Yposition and the like")
    return names


def _read_motion(lines: list[str], start: int, width: int, path: Path) -> tuple[NDArray[np.float64], float]:
    """Channel values (T, width) and frames a second."""
    rows = [(number, line.split()) for number, line in enumerate(lines[start + 1 :], start + 2) if line.strip()]
    count = _field(rows, 0, ("Frames:",), path, start + 1)
    seconds = _field(rows, 1, ("Frame", "Time:"), path, start + 1)
    if count < 1 or count != int(count):
        raise GarmentcError("the number of frames is no positive whole number", path, rows[0][0])
    if seconds <= 0:
        raise GarmentcError("the frame time is not positive", path, rows[1][0])
    data = rows[2:]
    if len(data) < count:
        last = data[-1][0] if data else rows[1][0]
        raise GarmentcError(
            f"{int(count)} frames are announced, but {len(data)} follow; the file is cut off", path, last
        )
    data = data[: int(count)]
    for number, words in data:
        if len(words) != width:
            raise GarmentcError(f"the frame has {len(words)} numbers, the skeleton has {width} channels", path, number)
    frames = np.array([_read_frame(words, number, path) for number, words in data]).reshape(len(data), width)
    fps = 1 / seconds
    return frames, float(round(fps)) if abs(fps - round(fps)) < 0.01 * fps and round(fps) else fps


def _read_frame(words: list[str], number: int, path: Path) -> list[float]:
    try:
        values = list(map(float, words))
        if all(map(math.isfinite, values)):
            return values
    except ValueError:
        pass
    wrong = next(word for word in words if _number(word) is None)
    raise GarmentcError(f"'{wrong[:40]}' is no number", path, number)


def _field(rows: list[tuple[int, list[str]]], at: int, label: tuple[str, ...], path: Path, line: int) -> float:
    number, words = rows[at] if at < len(rows) else (line, [])
    value = _number(words[-1]) if len(words) == len(label) + 1 and tuple(words[:-1]) == label else None
    if value is None:
        raise GarmentcError(f"expected '{' '.join(label)} <number>'", path, number)
    return value


def _evaluate(joints: list[_Joint], frames: NDArray[np.float64], fps: float) -> BvhClip:
    """Forward kinematics. Channels apply in the order in which they are listed, the first outermost."""
    count, total = len(frames), len(joints)
    rest = np.zeros((total, 3))
    rotations = np.zeros((count, total, 3, 3))
    positions = np.zeros((count, total, 3))
    column = 0
    for k, joint in enumerate(joints):
        local = np.broadcast_to(np.eye(3), (count, 3, 3))
        place = np.tile(joint.offset, (count, 1))
        for channel in joint.channels:
            axis, values = _AXES.index(channel[0]), frames[:, column]
            if channel.endswith("rotation"):
                local = local @ axis_rotation(axis, np.radians(values))
            else:
                place[:, axis] = values
            column += 1
        if joint.parent < 0:
            rotations[:, k], positions[:, k] = local, place
        else:
            above = rotations[:, joint.parent]
            rest[k] = rest[joint.parent] + joint.offset
            rotations[:, k] = above @ local
            positions[:, k] = positions[:, joint.parent] + np.einsum("tij,tj->ti", above, place)
    return BvhClip(tuple(joint.name for joint in joints), rest, rotations, positions, fps)


def axis_rotation(axis: int, angles: NDArray[Any]) -> NDArray[np.float64]:
    """Rotations (T, 3, 3) about coordinate axis 0, 1 or 2 by angles (T,), radians."""
    i, j = (axis + 1) % 3, (axis + 2) % 3
    matrices = np.zeros((len(angles), 3, 3))
    matrices[:, axis, axis] = 1
    matrices[:, i, i] = matrices[:, j, j] = np.cos(angles)
    matrices[:, j, i] = np.sin(angles)
    matrices[:, i, j] = -np.sin(angles)
    return matrices
