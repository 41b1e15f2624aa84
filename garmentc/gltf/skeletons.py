"""The 24 joints under the names that other tools know them by, so that their animations and retargeters find them.

The hierarchy is SMPL's, which the humans of these tools have too: what they have beside it (fingers, a face) hangs on
it, but for the two more spine joints and the second neck joint of Unreal's fifth version. So only names differ, and
where the figure stands: SMPL's origin is near the pelvis; the others expect the soles at height 0. All joints are
unrotated at rest, in the T-pose, facing +Z; tools that retarget by rest pose allow for that.
"""

from __future__ import annotations

from dataclasses import dataclass

from garmentc.smpl.skeleton import JOINT_NAMES


@dataclass(frozen=True)
class Skeleton:
    """What a tool calls things.

    joints    24 names, in the order of SMPL's joints
    root      of the node above the pelvis; None leaves it to the asset's name
    grounded  the soles are at height 0
    """

    name: str
    joints: tuple[str, ...]
    root: str | None = None
    grounded: bool = True


def _paired(words: str, left: str, right: str) -> tuple[str, ...]:
    """Names in SMPL's order; `@` stands for a side, and such a name for two joints, left and right."""
    return tuple(
        name.replace("@", side) for name in words.split() for side in ((left, right) if "@" in name else ("",))
    )


SMPL = Skeleton("smpl", JOINT_NAMES, grounded=False)

VRM = Skeleton(
    "vrm",
    _paired(
        "hips @UpperLeg spine @LowerLeg chest @Foot upperChest @Toes neck @Shoulder head "
        "@UpperArm @LowerArm @Hand @MiddleProximal",
        "left",
        "right",
    ),
)
"""VRM 1.0, humanoid bones. SMPL's last joint is at the knuckles."""

MIXAMO = Skeleton(
    "mixamo",
    tuple(
        f"mixamorig:{name}"
        for name in _paired(
            "Hips @UpLeg Spine @Leg Spine1 @Foot Spine2 @ToeBase Neck @Shoulder Head @Arm @ForeArm @Hand @HandMiddle1",
            "Left",
            "Right",
        )
    ),
)
"""The skeleton of Mixamo's characters and animations."""

UNREAL = Skeleton(
    "unreal",
    _paired(
        "pelvis thigh_@ spine_01 calf_@ spine_02 foot_@ spine_03 ball_@ neck_01 clavicle_@ head "
        "upperarm_@ lowerarm_@ hand_@ middle_01_@",
        "l",
        "r",
    ),
    root="root",
)
"""Unreal Engine's mannequin, fourth version."""

SKELETONS = {skeleton.name: skeleton for skeleton in (SMPL, VRM, MIXAMO, UNREAL)}


def skeleton_of(names: tuple[str, ...]) -> Skeleton | None:
    """The skeleton whose joints have these names, in this order."""
    return next((skeleton for skeleton in SKELETONS.values() if skeleton.joints == names), None)
