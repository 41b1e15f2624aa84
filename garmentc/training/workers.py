"""Training in several processes, on one machine or many: each takes its share of a step's batches, gradients add up.

torchrun starts the processes and torch.distributed carries the sums; both are torch's own. Every process takes the same
steps, so a run is the same whatever the number of processes, but for the order in which numbers are added.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, TypeVar

import torch
import torch.distributed as distributed
from torch import Tensor, nn

_T = TypeVar("_T")
_CPU = torch.device("cpu")


@dataclass(frozen=True)
class Workers:
    """This process, number `rank` of `count`, and what it computes on."""

    rank: int = 0
    count: int = 1
    device: torch.device = _CPU

    @property
    def leads(self) -> bool:
        """Whether this process writes files and speaks."""
        return self.rank == 0

    def share(self, items: Sequence[_T]) -> Sequence[_T]:
        """Those of the items that this process takes."""
        return items[self.rank :: self.count]

    def summed(self, numbers: Tensor) -> Tensor:
        """`numbers` added up over all processes."""
        if self.count > 1:
            distributed.all_reduce(numbers)
        return numbers

    def sum_gradients(self, parameters: Iterable[nn.Parameter]) -> None:
        """Add the gradients of all processes up, in place; a missing one is zero."""
        if self.count == 1:
            return
        known = list(parameters)
        for parameter in known:
            if parameter.grad is None:
                parameter.grad = torch.zeros_like(parameter)
        flat = self.summed(torch.cat([parameter.grad.flatten() for parameter in known if parameter.grad is not None]))
        start = 0
        for parameter in known:
            assert parameter.grad is not None
            parameter.grad.copy_(flat[start : start + parameter.numel()].view_as(parameter))
            start += parameter.numel()

    def from_leader(self, value: Any) -> Any:
        """What the first process passed, in every process."""
        if self.count == 1:
            return value
        box = [value]
        distributed.broadcast_object_list(box)
        return box[0]


@contextmanager
def joined(cuda: bool = False) -> Iterator[Workers]:
    """The group that torchrun started this process in; alone where it did not.

    cuda  compute on CUDA devices, each process of a machine on its own
    """
    device = _CPU
    if cuda:
        device = torch.device("cuda", int(os.environ.get("LOCAL_RANK", "0")))
        torch.cuda.set_device(device)
    if int(os.environ.get("WORLD_SIZE", "1")) == 1:
        yield Workers(device=device)
        return
    distributed.init_process_group("cpu:gloo,cuda:nccl" if cuda else "gloo")
    try:
        yield Workers(distributed.get_rank(), distributed.get_world_size(), device)
    finally:
        distributed.destroy_process_group()
