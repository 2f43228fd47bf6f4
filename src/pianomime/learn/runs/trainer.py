"""Supervised training loop: AdamW, warm-up and cosine decay, an average of the weights (EMA).

It can be stopped at any instant and resumed to the same weights, bit for bit on the same processor
and number of cores: the batch of a step is sampled by a random generator that is seeded by the
config's seed and the number of the step, and so are all random numbers of torch in that step. The
weights, their average and the moments of the optimizer are in the checkpoint.

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

from pianomime.errors import InputError, TrainingDiverged
from pianomime.learn.runs.log import RunLog
from pianomime.learn.runs.run import RunFolder
from pianomime.learn.runs.safetensors_file import Arrays
from pianomime.learn.runs.torch_threads import torch_threads
from pianomime.learn.runs.trainer_config import MAY_DIFFER, TrainerConfig
from pianomime.progress import Progress, no_progress

Batch = dict[str, Tensor]
"""Named tensors whose first axis is that of the samples."""
Samples = Mapping[str, NDArray[Any]]
"""Named arrays whose first axis is that of the samples."""
Loss = Callable[[nn.Module, Batch], Tensor]
"""The mean loss of a batch. It calls the network it is given, not a part of it: that network may be
wrapped for several GPUs."""
SampleBatch = Callable[[np.random.Generator, int], Samples]
"""Samples so many, with this random generator alone; called a step ahead, from another thread."""
Evaluate = Callable[[nn.Module], dict[str, float]]
"""Metrics of a network, which is in eval mode, on the device where it is trained."""

_KIND = "network"
_MAX_GRAD_NORM = 1.0
"""Gradients are clipped to this norm."""
_LOG_SECONDS = 1.0
"""[s] between looks at the loss, each of which makes a GPU wait."""


def train_network(
    folder: Path,
    module: nn.Module,
    loss: Loss,
    sample_batch: SampleBatch,
    config: TrainerConfig,
    evaluate: Evaluate | None = None,
    progress: Progress = no_progress,
    depends_on: Mapping[str, Any] | None = None,
    held_out: Samples | None = None,
) -> None:
    """Train a network, or resume its training, or load one that is finished.

    The folder is that of a run (`RunFolder`), whose result are the averaged weights in float32.

    Args:
        folder: made if need be.
        module: the network with its initial weights. It has the trained ones when this returns, and
            is on the processor, in eval mode.
        loss: what is minimised.
        sample_batch: what is learned from.
        config: how to train.
        evaluate: measures the averaged weights; its metrics go to TensorBoard.
        progress: called with the updates that were done.
        depends_on: what else the weights depend on, such as the network's settings and the data;
            for JSON. A run is resumed only where it is the same.
        held_out: samples that are not learned from, whose loss is measured as well.

    Raises:
        InputError: what is in the folder cannot be used.
        TrainingDiverged: the loss is not a finite number any more; the checkpoint before stays.
        OSError: the folder cannot be written; the checkpoint before stays.
    """
    from accelerate import Accelerator

    # Precision is ours: that of `accelerate` changes the module for good.
    accelerator = Accelerator(mixed_precision="no")
    whole = {**(depends_on or {}), "trainer": dataclasses.asdict(config)}
    with ExitStack() as stack:
        if accelerator.is_main_process:
            names = [f"trainer.{name}" for name in MAY_DIFFER]
            stack.enter_context(RunFolder.open(folder, _KIND, whole, names))
        accelerator.wait_for_everyone()
        run = RunFolder.load(folder)
        if not run.has_result:
            learner = _Learner(module, config, accelerator)
            # One core is for the batches that are sampled meanwhile: on two cores, two threads take
            # nearly twice as long as one.
            with torch_threads(max(torch.get_num_threads() - 1, 1)):
                _train(run, learner, loss, sample_batch, evaluate, held_out, progress)
            accelerator.wait_for_everyone()
    # From the device where it was trained: what comes next has no need of one.
    load_weights(folder, module.to("cpu"))


def load_weights(folder: Path, module: nn.Module) -> None:
    """Put the result of a training into a network of its kind, in eval mode.

    Raises:
        InputError: nothing was trained to the end there, or a network of another shape, or the
            file is damaged.
    """
    run = RunFolder.load(folder)
    if not run.has_result:
        raise InputError(f"{folder}: this network is not trained to the end yet")
    load_arrays(module, run.result()[0], folder)
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

    def update(self, loss: Loss, samples: Samples) -> Tensor:
        """Learn from a batch.

        Returns:
            (2,) the loss and the norm of its gradient, on the device.
        """
        rank, processes = self._accelerator.process_index, self._accelerator.num_processes
        batch = self._batch({name: array[rank::processes] for name, array in samples.items()})
        noise = np.random.SeedSequence([self.config.seed, self.step, 1 + rank])
        torch.manual_seed(int(noise.generate_state(1)[0]))
        self._optimizer.param_groups[0]["lr"] = learning_rate(self.config, self.step)
        with torch.autocast(self._device.type, torch.bfloat16, enabled=self._low):
            value = loss(self._network, batch)
        self._accelerator.backward(value)
        norm = self._accelerator.clip_grad_norm_(self._parameters, _MAX_GRAD_NORM)
        self._optimizer.step()
        self._optimizer.zero_grad()
        self._average.step(self._parameters)
        self.step += 1
        return torch.stack((value.detach().float(), norm.float()))

    @contextmanager
    def averaged(self) -> Iterator[nn.Module]:
        """The network with its averaged weights, in eval mode, for a while."""
        self._average.store(self._parameters)
        self._average.copy_to(self._parameters)
        self.module.eval()
        try:
            with torch.no_grad():
                yield self.module
        finally:
            self._average.restore(self._parameters)
            self.module.train()

    def validation_loss(self, loss: Loss, samples: Samples) -> float:
        """Loss of the averaged weights on samples, with the same random numbers each time."""
        torch.manual_seed(0)
        with self.averaged() as module:
            return float(loss(module, self._batch(samples)))

    def _batch(self, samples: Samples) -> Batch:
        # Copied, for torch aligns its memory and numpy does not, which would show in last digits.
        return {name: torch.tensor(array).to(self._device) for name, array in samples.items()}

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
        except (LookupError, ValueError, TypeError, RuntimeError) as error:
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
    run: RunFolder,
    learner: _Learner,
    loss: Loss,
    sample_batch: SampleBatch,
    evaluate: Evaluate | None,
    held_out: Samples | None,
    progress: Progress,
) -> None:
    config = learner.config
    state = run.state()
    if state is not None:
        learner.resume(state.arrays, state.steps, run.path)

    def measured() -> dict[str, float]:
        metrics: dict[str, float] = {}
        if held_out is not None:
            metrics["trainer/validation_loss"] = learner.validation_loss(loss, held_out)
        if evaluate is not None:
            with learner.averaged() as module:
                metrics |= evaluate(module)
        return metrics

    since: list[Tensor] = []
    looked = saved = time.monotonic()
    # Seconds of waiting for batches, and of all but logging and writing.
    waited = spent = 0.0
    with ExitStack() as stack:
        log = None
        if learner.main:
            log = stack.enter_context(closing(RunLog(run.tensorboard, learner.step + 1)))
        batches = stack.enter_context(closing(_batches(sample_batch, config, learner.step)))
        for samples, asked in batches:
            waited += time.monotonic() - asked
            since.append(learner.update(loss, samples))
            spent += time.monotonic() - asked
            now, last = time.monotonic(), learner.step == config.steps
            save = last or now - saved > config.checkpoint_seconds
            every = config.evaluate_every
            measure = every and learner.step % every == 0 and not last
            if not (save or measure or now - looked > _LOG_SECONDS):
                continue
            # Before anything is kept.
            metrics = _look(since, learner.step) | {
                "trainer/learning_rate": learning_rate(config, learner.step - 1),
                "trainer/steps_per_second": len(since) / spent,
                "trainer/waiting_share": waited / spent,
            }
            since, looked, waited, spent = [], now, 0.0, 0.0
            if log is None:
                continue
            log.add(learner.step, metrics)
            remark = f"loss {metrics['trainer/loss']:.3g}"
            progress("training", learner.step, config.steps, remark)
            if measure:
                log.add(learner.step, measured())
            if save:
                run.checkpoint(learner.arrays(), learner.step)
                saved = time.monotonic()
        if log is not None:
            final = measured()
            log.add(learner.step, final)
            with learner.averaged() as module:
                run.keep_result(_arrays(module), final)


def _batches(
    sample_batch: SampleBatch, config: TrainerConfig, first: int
) -> Generator[tuple[Samples, float], None, None]:
    """The batch of each step from the first on, sampled while the one before is learned from.

    With each the time at which it was asked for.
    """

    def samples(step: int) -> Samples:
        return sample_batch(np.random.default_rng([config.seed, step]), config.batch)

    with ThreadPoolExecutor(1) as thread:
        coming: deque[Future[Samples]] = deque()
        for step in range(first, config.steps + 1):
            asked = time.monotonic()
            if step < config.steps:
                coming.append(thread.submit(samples, step))
            if step > first:
                yield coming.popleft().result(), asked


def _look(since: list[Tensor], step: int) -> dict[str, float]:
    """Mean loss and gradient norm of the last updates, the latest of which is the step-th.

    Raises:
        TrainingDiverged: one is not a finite number.
    """
    values = torch.stack(since).cpu()
    wrong = (~values.isfinite()).any(dim=1).nonzero()
    if len(wrong):
        first = step - len(since) + 1 + int(wrong[0, 0])
        raise TrainingDiverged(
            f"the loss or its gradient is not a finite number at step {first}: "
            "try a lower trainer.learning-rate, in another folder"
        )
    loss, gradient = values.mean(dim=0).tolist()
    return {"trainer/loss": loss, "trainer/gradient_norm": gradient}


def _arrays(module: nn.Module) -> Arrays:
    return {name: tensor.cpu().numpy() for name, tensor in module.state_dict().items()}


def load_arrays(module: nn.Module, arrays: Arrays, path: Path) -> None:
    """Put weights that were read from a path into a network.

    Raises:
        InputError: they are those of another.
    """
    try:
        module.load_state_dict({name: torch.tensor(array) for name, array in arrays.items()})
    except (RuntimeError, TypeError) as error:
        raise InputError(f"{path}: holds the weights of another network") from error
