"""A training run as a method of `garmentc.evaluation`: how variants are measured that no bundle can express."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from garmentc.evaluation.method import Method, PosedTemplate
from garmentc.simulation.sequence import Sample
from garmentc.simulation.sequence import Sequence as OutfitSequence
from garmentc.smpl.body import BodyModel


@dataclass(frozen=True)
class RunMethod(Method):
    """The network of the run in the folder `run`, in torch, four influences a vertex: the rig before all passes.

    Metadata of the sequence are told to a network that was trained with them.
    """

    run: Path = Path()

    def posed_template(self, sequence: OutfitSequence, body: BodyModel, body_file: Path | None) -> PosedTemplate:
        """The outfit of `sequence`, moved. Raises GarmentcError where the run is none, or metadata are missing."""
        from garmentc.training.metadata import metadata_of
        from garmentc.training.outfit_sample import PosableBody, make_sample
        from garmentc.training.predict import load_run, poser

        checkpoint = load_run(self.run)
        network, facts = checkpoint.restored(), sequence.facts
        metadata = metadata_of(checkpoint.recipe.metadata, facts)
        sample = make_sample(facts.outfit, sequence.template, sequence.faces, PosableBody.of(body, sequence.betas))
        together = poser(network, sample, metadata=metadata)

        def posed(frame: Sample) -> NDArray[np.float64]:
            vertices: NDArray[np.float64] = together(frame.pose[None].astype(np.float64))[0].astype(np.float64)
            return vertices

        return posed


def run_method(folder: Path) -> RunMethod:
    """The method of a run, called by its folder's name."""
    return RunMethod(name=folder.name, run=folder)
