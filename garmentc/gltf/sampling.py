"""Values of an animation channel between its keyframes (glTF 2.0 section 3.11 and appendix C)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from garmentc.gltf.glb_asset import Channel


def sample(channel: Channel, seconds: float) -> NDArray[np.float64]:
    """A channel's value at a time (glTF 2.0 section 3.11 and appendix C)."""
    times = channel.times.astype(np.float64)
    values = channel.values.astype(np.float64)
    cubic = channel.interpolation == "CUBICSPLINE"
    values = values.reshape(len(times), 3, -1) if cubic else values[:, None]
    middle = 1 if cubic else 0  # a cubic keyframe is in-tangent, value, out-tangent
    after = int(np.searchsorted(times, seconds, side="right"))
    if after == 0 or after == len(times) or channel.interpolation == "STEP":
        held: NDArray[np.float64] = values[max(after - 1, 0), middle]
        return held
    before = after - 1
    step = times[after] - times[before]
    amount = (seconds - times[before]) / step
    a, b = values[before, middle], values[after, middle]
    if cubic:
        t, t2, t3 = amount, amount**2, amount**3
        out_tangent, in_tangent = step * values[before, 2], step * values[after, 0]
        mixed: NDArray[np.float64] = (2 * t3 - 3 * t2 + 1) * a + (t3 - 2 * t2 + t) * out_tangent
        mixed += (3 * t2 - 2 * t3) * b + (t3 - t2) * in_tangent
        return unit(mixed) if channel.path == "rotation" else mixed
    if channel.path == "rotation":
        return _slerp(a, b, amount)
    line: NDArray[np.float64] = a + amount * (b - a)
    return line


def _slerp(a: NDArray[np.float64], b: NDArray[np.float64], amount: float) -> NDArray[np.float64]:
    a, b = unit(a), unit(b)
    if a @ b < 0:
        b = -b
    sine = np.linalg.norm(a - b) * np.linalg.norm(a + b) / 2  # accurate for small angles, unlike the arc cosine
    angle = np.arctan2(sine, a @ b)
    if sine < 1e-12:
        return a
    return unit(np.sin((1 - amount) * angle) * a + np.sin(amount * angle) * b)


def unit(vector: NDArray[np.float64]) -> NDArray[np.float64]:
    scaled: NDArray[np.float64] = vector / np.linalg.norm(vector)
    return scaled
