"""What is measured on a dataset: bundles compiled with a profile, and what they are compared with."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from garmentc.errors import GarmentcError
from garmentc.evaluation.baselines import nearest_skinning
from garmentc.evaluation.posed_outfit import read_outfit
from garmentc.families.bundle import DEFAULT_BUNDLE, MANIFEST, load_bundle
from garmentc.mesh_file import write_mesh
from garmentc.options import CompileOptions, ProfileName
from garmentc.pipeline import compile_outfit, dress, infer, read_inputs
from garmentc.simulation.sequence import Sample
from garmentc.simulation.sequence import Sequence as OutfitSequence
from garmentc.smpl.body import BodyModel

MeasuredProfile = Literal[ProfileName, "network"]
"""A profile of `garmentc compile`, or "network": the rig that the networks make, before all passes, in no file."""

MEASURED_PROFILES: tuple[MeasuredProfile, ...] = (*get_args(ProfileName), "network")

NEAREST = "nearest"
SIMULATION = "simulation"

MATCH = 2e-4
"""Metres that a vertex of a compiled file may be away from the template's at rest: quantization moves it by less."""

PosedTemplate = Callable[[Sample], NDArray[np.float64]]
"""A frame of a sequence to the template's vertices (N, 3) in it, metres, the pelvis where it is at rest."""


@dataclass(frozen=True)
class Method:
    """One way to move outfits. A subclass with a `posed_template` of its own can measure anything else.

    name     what tables call it
    bundle   folder of a model bundle; None for NEAREST
    profile  that its files are compiled with; None for NEAREST
    told     whether the bundle is told the fabric that an outfit is made of
    animated whether outfits are compiled with the motion of each sequence, and measured along that animation
    """

    name: str
    bundle: Path | None = None
    profile: MeasuredProfile | None = None
    told: bool = False
    animated: bool = False

    def told_fabrics(self) -> Method:
        """The same with that knowledge."""
        return replace(self, name=f"{self.name}, told the fabric", told=True)

    def with_animations(self) -> Method:
        """The same along animations, where its files have any."""
        if self.profile in (None, "network"):
            return self
        return replace(self, name=f"{self.name}, animated", animated=True)

    def posed_template(self, sequence: OutfitSequence, body: BodyModel, body_file: Path | None) -> PosedTemplate:
        """The outfit of `sequence`, moved.

        body, body_file  that the sequence was made on; None is the default one
        Raises GarmentcError where the outfit cannot be compiled.
        """
        if self.bundle is None or self.profile is None:
            rig = nearest_skinning(sequence.template, sequence.faces, body, sequence.betas)
            return lambda sample: rig.posed(_pose(sample))
        with TemporaryDirectory(prefix="garmentc-") as folder:
            source = Path(folder) / "outfit.obj"
            write_mesh(source, sequence.template, sequence.faces)
            known = CompileOptions(
                body=body_file,
                gender=sequence.facts.gender,  # type: ignore[arg-type]
                betas=tuple(map(float, sequence.betas)),
                units="m",
                up="y",
                front="z",
                pose="t",
                unwrap="never",
                bundle=self.bundle,
                fabric=sequence.facts.fabric if self.told else None,
            )
            try:
                if self.profile == "network":
                    return _network_alone(source, known)
                if self.animated:
                    return _animated(source, known, self.profile, sequence)
                return _compiled(source, known, self.profile, sequence.template)
            except GarmentcError as error:
                if error.file is not None and Path(error.file).parent == Path(folder):  # a file that nobody can look at
                    raise GarmentcError(f"{sequence.facts.outfit} cannot be compiled: {error.message}") from error
                raise


NEAREST_METHOD = Method(NEAREST)


def named_methods(
    folders: Sequence[Path | None], profiles: Sequence[MeasuredProfile]
) -> dict[Path | None, tuple[Method, ...]]:
    """By folder the methods of bundles, and of training runs: some variants of a network have no bundle.

    Raises GarmentcError where a folder is neither.
    """
    runs = {folder for folder in folders if folder is not None and is_run(folder)}
    bundles = bundle_methods([folder for folder in folders if folder not in runs], profiles)
    methods: dict[Path | None, tuple[Method, ...]] = {}
    for folder in folders:
        if folder is not None and folder in runs:
            from garmentc.training.run_method import run_method

            methods[folder] = (run_method(folder),)
        else:
            methods[folder] = tuple(method for method in bundles if method.bundle == (folder or DEFAULT_BUNDLE))
    return methods


def is_run(folder: Path) -> bool:
    """Whether a folder is that of `garmentc train`, and not a bundle."""
    return (folder / "checkpoint.pt").is_file() and not (folder / MANIFEST).exists()


def bundle_methods(bundles: Sequence[Path | None], profiles: Sequence[MeasuredProfile]) -> tuple[Method, ...]:
    """Every bundle with every profile; None is the bundle that comes with garmentc.

    Bundles are called by the name in their manifests; where two have the same, the folder's is added.
    Raises GarmentcError where a bundle cannot be used.
    """
    folders = list(dict.fromkeys(DEFAULT_BUNDLE if bundle is None else bundle for bundle in bundles))
    names = [load_bundle(folder).name for folder in folders]
    called = [
        f"{name} ({folder})" if names.count(name) > 1 else name for name, folder in zip(names, folders, strict=True)
    ]
    return tuple(
        Method(f"{name}, {profile}", folder, profile)
        for name, folder in zip(called, folders, strict=True)
        for profile in dict.fromkeys(profiles)
    )


def _compiled(source: Path, known: CompileOptions, profile: ProfileName, template: NDArray[Any]) -> PosedTemplate:
    """The outfit as a user gets it: compiled to a file, and that file evaluated as an engine does it."""
    glb = source.with_suffix(".glb")
    compile_outfit(source, glb, known, profile=profile)
    outfit = read_outfit(glb)
    vertex = _same_places(outfit.rest, template)
    return lambda sample: outfit.posed(_pose(sample))[vertex]


def _animated(source: Path, known: CompileOptions, profile: ProfileName, sequence: OutfitSequence) -> PosedTemplate:
    """The outfit compiled with the motion of `sequence`, and that animation as an engine plays it."""
    glb, motion, fps = source.with_suffix(".glb"), source.with_suffix(".npz"), sequence.facts.fps
    np.savez(motion, poses=sequence.poses.reshape(len(sequence.poses), -1), trans=sequence.trans, fps=fps)
    compile_outfit(source, glb, known, profile=profile, motion=(motion,), motion_up="y")
    outfit = read_outfit(glb)
    vertex = _same_places(outfit.rest, sequence.template)
    return lambda sample: outfit.animated(0, sample.frame / fps)[1][vertex]


def _pose(sample: Sample) -> NDArray[np.float64]:
    return sample.pose.astype(np.float64)


def _same_places(rest: NDArray[np.float64], template: NDArray[Any]) -> NDArray[np.intp]:
    """For each vertex of the template (N, 3) the vertex of the file, `rest` (R, 3), that stands for it."""
    from scipy.spatial import cKDTree

    distance, vertex = cKDTree(rest).query(template)
    if distance.max() > MATCH:
        raise GarmentcError(
            f"the compiled file is not the outfit at rest: a vertex lies {1000 * distance.max():.2f} mm away"
        )
    nearest: NDArray[np.intp] = vertex
    return nearest


def _network_alone(source: Path, known: CompileOptions) -> PosedTemplate:
    inputs = read_inputs(source, known)
    dressed = dress(inputs, known)
    rig = infer(inputs.bundle, dressed, known.fabric)
    vertex = dressed.welded.vertex_of
    return lambda sample: rig.posed(_pose(sample))[vertex]
