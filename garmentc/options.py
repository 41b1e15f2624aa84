"""What a compile can be told: one frozen dataclass for the command line and the Python API alike."""

from __future__ import annotations

from dataclasses import dataclass, fields
from pathlib import Path
from typing import Literal, get_args

from garmentc.errors import GarmentcError

Family = Literal["deepsd"]
Gender = Literal["auto", "female", "male", "neutral"]
RestPose = Literal["auto", "t", "a"]
Sparse = Literal["auto", "never"]
Units = Literal["auto", "m", "dm", "cm", "mm", "in", "ft"]
Unwrap = Literal["auto", "never", "always"]
Axis = Literal["auto", "x", "y", "z", "-x", "-y", "-z"]
MotionUp = Literal["auto", "y", "z"]
ProfileName = Literal["mobile", "web", "desktop", "reference"]
SkeletonName = Literal["smpl", "vrm", "mixamo", "unreal"]

_CHOICES = {
    "gender": get_args(Gender),
    "motion_up": get_args(MotionUp),
    "units": get_args(Units),
    "up": get_args(Axis),
    "front": get_args(Axis),
    "pose": get_args(RestPose),
    "profile": get_args(ProfileName),
    "sparse": (*get_args(Sparse), None),
    "skeleton": get_args(SkeletonName),
    "unwrap": get_args(Unwrap),
    "family": get_args(Family),
    "influences": (4, 8, None),
}


_MOST_MORPHS = 128
"""Of the morph targets that several engines draw no more."""


@dataclass(frozen=True)
class Profile:
    """Pass settings with a name.

    influences  joints that may move a vertex: 4 or 8
    morphs      blend shapes written, of which one balances the others where there are several; None keeps all
    animation_morphs  blend shapes more, at most, that only the animations use
    quantize    integer vertex attributes instead of float32
    sparse      store a morph target's zeros implicitly where that is smaller; of quantized files only those that are
                compressed (meshopt), unless a compile asks for it
    """

    influences: int
    morphs: int | None
    animation_morphs: int
    quantize: bool
    sparse: Sparse


PROFILES: dict[ProfileName, Profile] = {
    "mobile": Profile(influences=4, morphs=8, animation_morphs=0, quantize=True, sparse="auto"),
    "web": Profile(influences=4, morphs=32, animation_morphs=64, quantize=True, sparse="auto"),
    "desktop": Profile(influences=8, morphs=64, animation_morphs=64, quantize=False, sparse="auto"),
    "reference": Profile(influences=8, morphs=None, animation_morphs=0, quantize=False, sparse="never"),
}


@dataclass(frozen=True)
class CompileOptions:
    """Every option of `garmentc compile`, by the same name. Paths may be given as strings.

    body                     the user's SMPL, SMPL-H or SMPL-X model; None is the default body
    gender                   "auto" takes the body that the outfit fits best
    betas                    shape coefficients of the body that the outfit fits; None takes those of `params`
    params                   JSON or npz file of gender, betas and pose; the pose is the one the outfit is modelled in
    motion                   motion files (AMASS npz or BVH), one or several; each becomes an animation
    motion_up                up axis of the motions
    units, up, front, pose   of the outfit; "auto" detects and reports
    profile                  named settings of the passes; the six options after it override single ones
    influences               4 or 8
    morphs                   number of blend shapes
    animation_morphs         number of blend shapes more that only the animations use, at most; 0 leaves these to the
                             pose keys
    morph_tolerance          metres; as few blend shapes as keep the error below it
    quantize, sparse         see Profile
    unwrap                   make texture coordinates where there are none
    allow_external_textures  read textures outside the OBJ's folder
    pose_keys                write the pose-key network into the glb
    meshopt                  compress the glb with EXT_meshopt_compression
    skeleton                 whose names the joints have; all but "smpl" also stand on the ground
    with_body                write the body beside the outfit, as a second mesh on the same skeleton
    keys_onnx                also write the pose-key network as an ONNX file
    fabric                   that the outfit is made of, one that the bundle knows; None is unknown
    bundle                   folder of a model bundle; None is the one that ships with the package
    family                   model family
    name                     name of the asset; None is the OBJ's file name
    """

    body: Path | None = None
    gender: Gender = "auto"
    betas: tuple[float, ...] | None = None
    params: Path | None = None
    motion: tuple[Path, ...] = ()
    motion_up: MotionUp = "auto"
    units: Units = "auto"
    up: Axis = "auto"
    front: Axis = "auto"
    pose: RestPose = "auto"
    profile: ProfileName = "web"
    influences: int | None = None
    morphs: int | None = None
    animation_morphs: int | None = None
    morph_tolerance: float | None = None
    quantize: bool | None = None
    sparse: Sparse | None = None
    unwrap: Unwrap = "auto"
    allow_external_textures: bool = False
    pose_keys: bool = True
    meshopt: bool = False
    skeleton: SkeletonName = "smpl"
    with_body: bool = False
    keys_onnx: Path | None = None
    fabric: str | None = None
    bundle: Path | None = None
    family: Family = "deepsd"
    name: str | None = None

    def __post_init__(self) -> None:
        for name in ("body", "params", "keys_onnx", "bundle"):
            if getattr(self, name) is not None:
                object.__setattr__(self, name, Path(getattr(self, name)))
        given = (self.motion,) if isinstance(self.motion, (str, Path)) else self.motion
        object.__setattr__(self, "motion", tuple(Path(motion) for motion in given))
        if self.betas is not None:
            object.__setattr__(self, "betas", tuple(float(beta) for beta in self.betas))
        self._check()

    def _check(self) -> None:
        """Raise GarmentcError for the first value that no compile could use."""
        for name, choices in _CHOICES.items():
            if getattr(self, name) not in choices:
                offered = ", ".join(str(choice) for choice in choices if choice is not None)
                raise GarmentcError(f"{name} is {getattr(self, name)!r}; choose one of {offered}")
        if self.morphs is not None and self.morphs < 0:
            raise GarmentcError(f"morphs is {self.morphs}; choose 0 or more")
        if self.animation_morphs is not None and self.animation_morphs < 0:
            raise GarmentcError(f"animation_morphs is {self.animation_morphs}; choose 0 or more")
        if self.morph_tolerance is not None and not self.morph_tolerance > 0:
            raise GarmentcError(f"morph_tolerance is {self.morph_tolerance} m; choose a length above zero")
        if self.morphs is not None and self.morph_tolerance is not None:
            raise GarmentcError("morphs and morph_tolerance are both given; choose one")

    @property
    def settings(self) -> Profile:
        """The profile with this compile's own settings laid over it."""
        base = PROFILES[self.profile]
        own = {field.name: getattr(self, field.name) for field in fields(Profile)}
        chosen = {name: getattr(base, name) if value is None else value for name, value in own.items()}
        if self.animation_morphs is None and self.morphs is not None:
            chosen["animation_morphs"] = min(chosen["animation_morphs"], max(0, _MOST_MORPHS - self.morphs))
        if self.sparse is None and chosen["quantize"] and not self.meshopt:
            # glTF-Transform 4.5 writes sparse accessors of fractions as zeros, and they save about a tenth.
            chosen["sparse"] = "never"
        return Profile(**chosen)
