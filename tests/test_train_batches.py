"""Which batches each step has: everything once an epoch, whoever asks, in whatever order."""

from __future__ import annotations

from collections import Counter

from garmentc.training.batch_plan import BatchPlan

COUNTS = (50, 7, 0, 24, 25)


def plan(**changes: object) -> BatchPlan:
    values = {"pose_counts": COUNTS, "poses": 12, "steps": 40, "per_step": (1, 2, 5), "seed": (3, 0), **changes}
    return BatchPlan(**values)  # type: ignore[arg-type]


def test_every_pose_of_every_outfit_comes_once_an_epoch() -> None:
    made = plan()
    for epoch in range(3):
        numbers = range(epoch * made.batches_per_epoch, (epoch + 1) * made.batches_per_epoch)
        seen = Counter((batch.outfit, pose) for batch in map(made.batch, numbers) for pose in batch.poses.tolist())
        assert seen == Counter((outfit, pose) for outfit, count in enumerate(COUNTS) for pose in range(count))
        assert max(len(made.batch(number).poses) for number in numbers) <= 12


def test_epochs_and_seeds_differ() -> None:
    made = plan()
    whole = range(made.batches_per_epoch)

    def order(of: BatchPlan, epoch: int) -> list[tuple[int, ...]]:
        batches = [of.batch(epoch * of.batches_per_epoch + number) for number in whole]
        return [(batch.outfit, *batch.poses.tolist()) for batch in batches]

    assert order(made, 0) != order(made, 1)
    assert order(made, 0) != order(plan(seed=(4, 0)), 0)
    assert order(made, 0) == order(plan(), 0)


def test_steps_grow_and_follow_each_other_without_gaps() -> None:
    made = plan()
    numbers = [batch.number for step in range(40) for batch in made.of_step(step)]
    assert numbers == list(range(len(numbers)))
    assert [made.count(step) for step in range(40)] == [1] * 14 + [2] * 13 + [5] * 13
    assert made.first(40) == len(numbers)
    assert made.epoch(40) == len(numbers) / made.batches_per_epoch


def test_batches_have_seeds_of_their_own() -> None:
    made = plan()
    assert len({made.batch(number).seed for number in range(30)}) == 30
