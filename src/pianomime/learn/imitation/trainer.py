"""The training loop of every network that imitates: AdamW, a cosine, an average of the weights.

A training can be stopped at any instant and goes on to the same weights, bit for bit on the same
processor and number of cores. The batch of a step is drawn from a generator seeded by the
training's seed and the number of the step, and so is all that torch draws in that step. The rest,
weights, their average and the optimizer's moments, is in the checkpoint.

On a GPU the network is compiled. On several, under `accelerate launch`, each has its share of every
batch. On a processor with instructions for it, matrices are multiplied in bfloat16.
"""

from __future__ import annotations

import dataclasses
import math
import time
from collections import deque
from collections.abc import Callable, Generator, Iterator, Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import ExitStack, closing, contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from pianomime.errors import InputError
from pianomime.learn.imitation.trainer_config import TrainerConfig, check_fit
from pianomime.learn.runs.fit_folder import FitFolder
from pianomime.learn.runs.lock import run_lock
from pianomime.learn.runs.log import RunLog
from pianomime.learn.runs.safetensors_file import Arrays
from pianomime.learn.runs.tell import Tell
from pianomime.learn.runs.torch_threads import torch_threads

Batch = dict[str, Tensor]
"""Named tensors whose first axis is that of the samples."""
Loss = Callable[[nn.Module, Batch], Tensor]
"""The mean loss of a batch. It calls the network it is given, not a part of it: what that is may be
wrapped for several GPUs."""
Draw = Callable[[np.random.Generator, int], Mapping[str, NDArray[Any]]]
"""So many samples, drawn by this generator alone; called a step ahead, from another thread."""
Evaluate = Callable[[nn.Module], dict[str, float]]
"""Figures of a network, which is in eval mode, on the device where it is trained."""

_GRADIENT_NORM = 1.0
"""Largest."""
_PAUSE = 1.0
"""[s] Between looks at the loss: each makes a GPU wait."""


def fit(
    folder: Path,
    module: nn.Module,
    loss: Loss,
    draw: Draw,
    config: TrainerConfig,
    evaluate: Evaluate | None = None,
    tell: Tell | None = None,
    about: Mapping[str, Any] | None = None,
) -> None:
    """Train a network, or go on where its training was, or take one that is finished.

    The folder then holds `weights.safetensors`, the averaged weights in float32, and `config.json`.

    Args:
        folder: made if need be.
        module: the network as it begins. It is the result when this returns, on the processor, in
            eval mode.
        loss: what to make small.
        draw: what to learn from.
        config: how to train.
        evaluate: measures the averaged weights; its figures go to TensorBoard.
        tell: told how far it is.
        about: what else the weights depend on, such as the network's settings and the data; for
            JSON. A training goes on only where it is the same.

    Raises:
        InputError: the config or what is in the folder cannot be used; or the loss is no finite
            number any more, and the checkpoint before that stays.
        OSError: the folder cannot be written; the checkpoint before stays.
    """
    from accelerate import Accelerator

    check_fit(config)
    # Precision is ours: that of `accelerate` changes the module for good.
    accelerator = Accelerator(mixed_precision="no")
    whole = {**(about or {}), "fit": dataclasses.asdict(config)}
    with ExitStack() as stack:
        if accelerator.is_main_process:
            stack.enter_context(run_lock(folder))
            FitFolder.open(folder, whole)
        accelerator.wait_for_everyone()
        there = FitFolder(folder)
        if not there.finished:
            learner = _Learner(module, config, accelerator)
            # One core is for the batches that are drawn meanwhile: on two cores, two threads take
            # nearly twice as long as one.
            with torch_threads(max(torch.get_num_threads() - 1, 1)):
                _train(there, learner, loss, draw, evaluate, tell)
            accelerator.wait_for_everyone()
    # From the device where it was trained: what comes next has no need of one.
    load_weights(folder, module.to("cpu"))


def load_weights(folder: Path, module: nn.Module) -> None:
    """Put the result of a training into a network of its kind, in eval mode.

    Raises:
        InputError: nothing was trained to the end there, or a network of another shape, or the
            file is damaged.
    """
    load_arrays(module, FitFolder(folder).weights()[0], folder)
    module.eval()


def learning_rate(config: TrainerConfig, step: int) -> float:
    """Of an update, counted from 0."""
    if step < config.warmup:
        return config.learning_rate * (step + 1) / (config.warmup + 1)
    done = (step - config.warmup) / (config.steps - config.warmup)
    return config.learning_rate * 0.5 * (1.0 + math.cos(math.pi * done))


def has_bfloat16(device: torch.device) -> bool:
    """Whether a device has instructions for bfloat16; without, it is slower than float32."""
    if device.type == "cuda":
        return bool(torch.cuda.is_bf16_supported(including_emulation=False))
    known = torch.cpu.get_capabilities() if device.type == "cpu" else {}
    return any(known.get(name, False) for name in ("avx512_bf16", "amx_bf16", "bf16"))


class _Learner:
    """A network in training, the average of its weights, and its optimizer.

    Attributes:
        module: the network itself.
        config: how it is trained.
        main: whether this process is the one that writes.
        step: updates done.
    """

    def __init__(self, module: nn.Module, config: TrainerConfig, accelerator: Any) -> None:
        from diffusers.training_utils import EMAModel

        self.module, self.config = module, config
        self.main: bool = accelerator.is_main_process
        self.step = 0
        self._accelerator = accelerator
        self._device: torch.device = accelerator.device
        self._network: nn.Module = accelerator.prepare_model(module.train())
        if self._device.type == "cuda":
            self._network = torch.compile(self._network)  # type: ignore[assignment]
        self._parameters = list(module.parameters())
        self._optimizer = torch.optim.AdamW(
            self._parameters, config.learning_rate, weight_decay=config.weight_decay, fused=True
        )
        self._average = EMAModel(
            self._parameters,
            use_ema_warmup=True,
            inv_gamma=1.0,
            power=config.ema_power,
            foreach=True,
        )
        self._low = config.bfloat16 and has_bfloat16(self._device)

    def update(self, loss: Loss, drawn: Mapping[str, NDArray[Any]]) -> Tensor:
        """Learn from a batch.

        Returns:
            (2,) the loss and the norm of its gradient, on the device.
        """
        rank, processes = self._accelerator.process_index, self._accelerator.num_processes
        # Copied, for torch aligns its memory and numpy does not, which would show in last digits.
        batch = {
            name: torch.tensor(array[rank::processes]).to(self._device)
            for name, array in drawn.items()
        }
        noise = np.random.SeedSequence([self.config.seed, self.step, 1 + rank])
        torch.manual_seed(int(noise.generate_state(1)[0]))
        self._optimizer.param_groups[0]["lr"] = learning_rate(self.config, self.step)
        with torch.autocast(self._device.type, torch.bfloat16, enabled=self._low):
            value = loss(self._network, batch)
        self._accelerator.backward(value)
        norm = self._accelerator.clip_grad_norm_(self._parameters, _GRADIENT_NORM)
        self._optimizer.step()
        self._optimizer.zero_grad()
        self._average.step(self._parameters)
        self.step += 1
        return torch.stack((value.detach().float(), norm.float()))

    @contextmanager
    def averaged(self) -> Iterator[nn.Module]:
        """The network with its averaged weights, to be looked at."""
        self._average.store(self._parameters)
        self._average.copy_to(self._parameters)
        self.module.eval()
        try:
            with torch.no_grad():
                yield self.module
        finally:
            self._average.restore(self._parameters)
            self.module.train()

    def arrays(self) -> Arrays:
        """Everything that is needed to go on, but for the step."""
        arrays = {f"module/{name}": array for name, array in _arrays(self.module).items()}
        for index, tensor in enumerate(self._average.shadow_params):
            arrays[f"average/{index}"] = tensor.cpu().numpy()
        for index, fields in self._optimizer.state_dict()["state"].items():
            for field, tensor in fields.items():
                arrays[f"adam/{index}/{field}"] = tensor.cpu().numpy()
        return arrays

    def resume(self, arrays: Arrays, step: int, path: Path) -> None:
        """Go on from a checkpoint.

        Raises:
            InputError: it is that of another network.
        """
        parts: dict[str, Arrays] = {"module": {}, "average": {}, "adam": {}}
        for name, array in arrays.items():
            part, _, rest = name.partition("/")
            parts.setdefault(part, {})[rest] = array
        load_arrays(self.module, parts["module"], path)
        self.step = step
        try:
            self._resume_moments(parts["average"], parts["adam"])
        except (LookupError, ValueError, RuntimeError) as error:
            raise InputError(f"{path}: the checkpoint does not fit the config") from error

    def _resume_moments(self, averages: Arrays, moments: Arrays) -> None:
        average = [torch.tensor(averages[str(i)]) for i in range(len(self._parameters))]
        self._average.load_state_dict({"optimization_step": self.step, "shadow_params": average})
        self._average.to(self._device)
        known = self._optimizer.state_dict()
        known["state"] = {}
        for name, array in moments.items():
            index, _, field = name.partition("/")
            known["state"].setdefault(int(index), {})[field] = torch.tensor(array)
        self._optimizer.load_state_dict(known)


def _train(
    folder: FitFolder,
    learner: _Learner,
    loss: Loss,
    draw: Draw,
    evaluate: Evaluate | None,
    tell: Tell | None,
) -> None:
    config = learner.config
    state = folder.state()
    if state is not None:
        learner.resume(*state, folder.path)
    since: list[Tensor] = []
    looked = saved = time.monotonic()
    # For batches, and in all that is neither looking nor keeping.
    waited = spent = 0.0
    with ExitStack() as stack:
        log = None
        if learner.main:
            log = stack.enter_context(closing(RunLog(folder.tensorboard, learner.step + 1)))
        for drawn, asked in stack.enter_context(closing(_batches(draw, config, learner.step))):
            waited += time.monotonic() - asked
            since.append(learner.update(loss, drawn))
            spent += time.monotonic() - asked
            now, last = time.monotonic(), learner.step == config.steps
            save = last or now - saved > config.checkpoint_seconds
            every = config.evaluate_every
            measure = evaluate is not None and every and learner.step % every == 0 and not last
            if not (save or measure or now - looked > _PAUSE):
                continue
            # Before anything is kept.
            figures = _look(since, learner.step) | {"fit/waited": waited / spent}
            since, looked, waited, spent = [], now, 0.0, 0.0
            if log is None:
                continue
            log.add(learner.step, figures)
            if tell is not None:
                tell(learner.step, config.steps, f"loss {figures['fit/loss']:.3g}")
            if measure:
                log.add(learner.step, _measure(learner, evaluate))
            if save:
                folder.checkpoint(learner.arrays(), learner.step)
                saved = time.monotonic()
        if log is not None:
            measured = _measure(learner, evaluate)
            log.add(learner.step, measured)
            with learner.averaged() as module:
                folder.finish(_arrays(module), measured)


def _batches(
    draw: Draw, config: TrainerConfig, first: int
) -> Generator[tuple[Mapping[str, NDArray[Any]], float], None, None]:
    """The batch of each step from the first on, drawn while the one before is learned from.

    With each the time at which it was asked for.
    """

    def drawn(step: int) -> Mapping[str, NDArray[Any]]:
        return draw(np.random.default_rng([config.seed, step]), config.batch)

    with ThreadPoolExecutor(1) as thread:
        coming: deque[Future[Mapping[str, NDArray[Any]]]] = deque()
        for step in range(first, config.steps + 1):
            asked = time.monotonic()
            if step < config.steps:
                coming.append(thread.submit(drawn, step))
            if step > first:
                yield coming.popleft().result(), asked


def _look(since: list[Tensor], step: int) -> dict[str, float]:
    """Mean loss and gradient of the last updates, the latest of which is the step-th.

    Raises:
        InputError: one is not a finite number.
    """
    seen = torch.stack(since).cpu()
    wrong = (~seen.isfinite()).any(dim=1).nonzero()
    if len(wrong):
        first = step - len(since) + 1 + int(wrong[0, 0])
        raise InputError(
            f"the loss or its gradient is no finite number at step {first}: "
            "try a lower fit.learning-rate, in another folder"
        )
    loss, gradient = seen.mean(dim=0).tolist()
    return {"fit/loss": loss, "fit/gradient_norm": gradient}


def _measure(learner: _Learner, evaluate: Evaluate | None) -> dict[str, float]:
    if evaluate is None:
        return {}
    with learner.averaged() as module:
        return evaluate(module)


def _arrays(module: nn.Module) -> Arrays:
    return {name: tensor.cpu().numpy() for name, tensor in module.state_dict().items()}


def load_arrays(module: nn.Module, arrays: Arrays, path: Path) -> None:
    """Put weights that were read from a path into a network.

    Raises:
        InputError: they are those of another.
    """
    weights = {name: torch.tensor(array) for name, array in arrays.items()}
    try:
        module.load_state_dict(weights)
    except RuntimeError as error:
        raise InputError(f"{path}: holds the weights of another network") from error
