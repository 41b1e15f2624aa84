"""Train the bundle that comes with garmentc: `python -m garmentc.training --out FOLDER`.

Runs on one CPU; may be stopped at any time and goes on where its last checkpoint was.
"""

from __future__ import annotations

import argparse
from dataclasses import asdict
from pathlib import Path

import torch

from garmentc.training.procedural_examples import HELD_OUT_SEED, make_examples
from garmentc.training.train_deepsd import TrainingConfig, measure, train
from garmentc.training.write_bundle import write_bundle

DESCRIPTION = (
    "DeePSD trained without simulation: procedural outfits on the default body, physics losses over sampled poses."
)


def main() -> None:
    """Make the outfits, train, measure on outfits and poses that were not trained on, write the bundle."""
    parser = argparse.ArgumentParser(prog="python -m garmentc.training", description=__doc__)
    parser.add_argument("--out", type=Path, required=True, help="folder for outfits, checkpoint, log and bundle")
    parser.add_argument("--outfits", type=int, default=160)
    parser.add_argument("--poses", type=int, default=64, help="poses per outfit")
    parser.add_argument("--held-out", type=int, default=12, help="outfits for measuring only")
    parser.add_argument("--minutes", type=float, default=TrainingConfig.minutes)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--version", default="0.1.0", help="version of the bundle")
    options = parser.parse_args()
    torch.set_num_threads(options.threads)
    config = TrainingConfig(seed=options.seed, minutes=options.minutes)
    cache = options.out / "outfits"
    options.out.mkdir(parents=True, exist_ok=True)
    with (options.out / "log.txt").open("a", encoding="utf-8", buffering=1) as file:

        def log(line: str) -> None:
            print(line, flush=True)
            file.write(line + "\n")

        held_out = make_examples(options.held_out, 32, cache, HELD_OUT_SEED)
        examples = make_examples(options.outfits, options.poses, cache)
        nearest = measure(None, held_out)
        log(f"{len(examples)} outfits; nearest-vertex skinning of the held-out ones: {nearest}")
        network = train(examples, held_out, config, options.out, log=log)
        figures = measure(network, held_out)
        log(f"held-out outfits: {figures}")
    record = {
        "config": asdict(config),
        "outfits": len(examples),
        "poses_per_outfit": options.poses,
        "held_out": {"outfits": len(held_out), "network": figures, "nearest_vertex_skinning": nearest},
        "command": f"python -m garmentc.training --outfits {options.outfits} --poses {options.poses} "
        f"--held-out {options.held_out} --minutes {options.minutes:g} --seed {options.seed} --out runs/deepsd",
    }
    bundle = options.out / "bundle"
    write_bundle(network, bundle, version=options.version, description=DESCRIPTION, training=record)
    print(f"bundle written to {bundle}")


if __name__ == "__main__":
    main()
