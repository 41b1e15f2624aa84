"""CLOTH3D (Bertiche, Madadi and Escalera 2020) as published: one folder a sample.

    <sample>/info.mat         SMPL parameters, garments, fabrics, tightness
    <sample>/<Garment>.obj    the garment at rest
    <sample>/<Garment>.pc16   its vertices in every frame

What the files leave to their readers, from the dataset's starter kit:

- Z is up. `zrot` turns everything, body and cloth, about it, after the rest.
- Cloth is relative to the body's pelvis joint; `trans` is where the pelvis is.
- The garment at rest is on the body in a star pose, legs apart by 0.15 rad each, Z up, pelvis at the origin.
- `poses` is (72, T), or (72,) for samples of one frame. gender 0 is female, 1 male.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from garmentc.errors import GarmentcError
from garmentc.outfit.align.unpose import unpose
from garmentc.outfit.obj import read_obj
from garmentc.outfit.outfit import Outfit
from garmentc.simulation.importers.point_cache import read_point_cache
from garmentc.simulation.sequence import QualityTrack, Sequence, SequenceFacts, Texcoords
from garmentc.smpl.arrays import numbers
from garmentc.smpl.body import BodyModel
from garmentc.smpl.pose_layout import shortest
from garmentc.smpl.rotations import axis_angle_to_matrix, matrix_to_quaternion, quaternion_to_axis_angle
from garmentc.smpl.skeleton import JOINT_COUNT, JOINT_NAMES

FPS = 30.0
STAR = 0.15
"""Radians that each leg is turned outwards in the rest pose."""

_CATEGORIES = {"tshirt": "top", "shirt": "top", "top": "top"}
_TO_Y_UP = axis_angle_to_matrix(np.array([-np.pi / 2, 0.0, 0.0]))


def cloth3d_samples(root: Path) -> list[Path]:
    """The folders of samples in `root`, sorted by name. Raises GarmentcError where there is none."""
    found = sorted(path.parent for path in root.glob("*/info.mat"))
    if not found:
        raise GarmentcError("holds no CLOTH3D samples: no folder in it has an info.mat", root)
    return found


def read_cloth3d_sample(folder: Path, bodies: Mapping[str, BodyModel]) -> Sequence:
    """The sample in `folder`, turned Y up, its garments at rest in the T-pose. Nothing in it is executed.

    bodies  SMPL by gender: the dataset's shapes mean nothing on another body
    Raises GarmentcError where a file is missing or damaged, or the body of the sample's gender is not there.
    """
    info = _read_info(folder / "info.mat")
    gender = "male" if int(info["gender"]) == 1 else "female"
    if gender not in bodies:
        raise GarmentcError(f"has a {gender} body; give SMPL's {gender} model too", folder)
    body = bodies[gender]
    betas = numbers(info, "shape", ("S",), folder / "info.mat")
    poses, pelvis = _columns(info, "poses", 3 * JOINT_COUNT, folder), _columns(info, "trans", 3, folder)
    names = _garment_names(info, folder)
    garments = [read_obj(folder / f"{name}.obj") for name in names]
    caches = [read_point_cache(folder / f"{name}.pc16") for name in names]
    for name, garment, cache in zip(names, garments, caches, strict=True):
        if cache.shape[1] != len(garment.vertices):
            said = f"has {cache.shape[1]} points, but the OBJ has {len(garment.vertices)} vertices"
            raise GarmentcError(said, folder / f"{name}.pc16")
    frames = min(len(poses), *(len(cache) for cache in caches))

    world = _TO_Y_UP @ axis_angle_to_matrix(np.array([0.0, 0.0, float(info.get("zrot", 0.0))]))
    poses = poses[:frames].reshape(frames, JOINT_COUNT, 3).copy()
    poses[:, 0] = quaternion_to_axis_angle(matrix_to_quaternion(world @ axis_angle_to_matrix(poses[:, 0])))
    cloth = np.concatenate([cache[:frames] for cache in caches], axis=1) + pelvis[:frames, None]
    start = np.cumsum([0, *(len(garment.vertices) for garment in garments)])
    rest = [_at_rest(garment, body, betas) for garment in garments]
    return Sequence(
        facts=_facts(folder, info, names, gender, body),
        template=np.concatenate(rest).astype(np.float32),
        faces=np.concatenate([g.tri_v + s for g, s in zip(garments, start, strict=False)]).astype(np.int32),
        triangle_part=np.repeat(np.arange(len(names)), [len(g.tri_v) for g in garments]).astype(np.int32),
        texcoords=_texcoords(garments),
        betas=betas.astype(np.float32),
        poses=shortest(poses).astype(np.float32),
        trans=(pelvis[:frames] @ world.T - body.joints(betas)[0]).astype(np.float32),
        vertices=(cloth @ world.T).astype(np.float32),
        quality=QualityTrack.unmeasured(frames),
    )


def _read_info(path: Path) -> dict[str, Any]:
    """MATLAB's structs as plain objects; scipy makes numbers, strings and structs of them and nothing else."""
    from scipy.io import loadmat

    try:
        info: dict[str, Any] = loadmat(path, squeeze_me=True, struct_as_record=False)
    except OSError as error:
        raise GarmentcError(f"cannot be read: {error.strerror or error}", path) from None
    except Exception as error:  # a damaged file can fail in any way
        raise GarmentcError(f"is no MATLAB file ({error})", path) from None
    missing = [key for key in ("poses", "shape", "trans", "gender", "outfit") if key not in info]
    if missing:
        raise GarmentcError(f"lacks {', '.join(missing)}", path)
    return info


def _columns(info: dict[str, Any], key: str, rows: int, folder: Path) -> NDArray[np.float64]:
    """`info[key]` (rows, T) as (T, rows); a single column counts as one frame."""
    array = np.asarray(info[key])
    single = {key: array[:, None] if array.ndim == 1 else array}
    return numbers(single, key, (rows, "T"), folder / "info.mat").T


def _garment_names(info: dict[str, Any], folder: Path) -> list[str]:
    names = list(getattr(info["outfit"], "_fieldnames", []))
    if not names or not all(re.fullmatch(r"[A-Za-z0-9_]{1,40}", name) for name in names):
        raise GarmentcError(f"'outfit' names no garments that could be files: {names}", folder / "info.mat")
    return names


def _at_rest(garment: Outfit, body: BodyModel, betas: NDArray[np.float64]) -> NDArray[np.float64]:
    """Vertices (N, 3) on the body in its T-pose."""
    pose = np.zeros((JOINT_COUNT, 3))
    pose[JOINT_NAMES.index("left_hip"), 2], pose[JOINT_NAMES.index("right_hip"), 2] = STAR, -STAR
    on_body = replace(garment, vertices=garment.vertices @ _TO_Y_UP.T + body.joints(betas)[0])
    return unpose(on_body, body, pose, betas)[0].vertices


def _texcoords(garments: list[Outfit]) -> Texcoords | None:
    if not all(garment.has_texcoords for garment in garments):
        return None
    start = np.cumsum([0, *(len(garment.texcoords) for garment in garments)])
    corners = np.concatenate([g.tri_vt + s for g, s in zip(garments, start, strict=False)])
    return Texcoords(np.concatenate([g.texcoords for g in garments]).astype(np.float32), corners.astype(np.int32))


def _facts(folder: Path, info: dict[str, Any], names: list[str], gender: str, body: BodyModel) -> SequenceFacts:
    fabrics = [str(getattr(getattr(info["outfit"], name), "fabric", "")) for name in names]
    kinds = sorted({_CATEGORIES.get(name.lower(), name.lower()) for name in names})
    return SequenceFacts(
        name=folder.name,
        outfit=folder.name,
        motion=re.sub(r"_s\d+$", "", folder.name),  # "135_02_s8" is a part of the recorded motion 135_02
        category="_".join(kinds),
        fabric="+".join(dict.fromkeys(fabrics)),
        body=body.name,
        gender=gender,
        fps=FPS,
        seed=0,
        parts=tuple(names),
        tightness=tuple(float(value) for value in np.atleast_1d(info.get("tightness", []))),
        parameters={},
    )
