from __future__ import annotations

import numpy as np
import pytest

from pianomime.policies.sampler import Sampler, alphas_cumprod, ddim_sample

diffusers = pytest.importorskip("diffusers", reason="needs the extra train")
torch = pytest.importorskip("torch")

STEPS = 100
NOISE = np.random.default_rng(0).standard_normal((3, 4, 5)).astype(np.float32)
TABLE = np.random.default_rng(1).standard_normal((STEPS, 4, 5)).astype(np.float32)


def network(noisy, step):
    """Something that depends on all it is given."""
    return np.tanh(0.5 * noisy + TABLE[step]).astype(np.float32)


def theirs(prediction, steps, eta):
    schedule = diffusers.DDIMScheduler(
        num_train_timesteps=STEPS,
        beta_schedule="squaredcos_cap_v2",
        prediction_type=prediction,
        clip_sample=True,
        timestep_spacing="trailing",
    )
    schedule.set_timesteps(steps)
    x = torch.from_numpy(NOISE)
    added = np.random.default_rng(7)
    for step in schedule.timesteps:
        said = torch.from_numpy(network(x.numpy(), np.full(len(x), int(step))))
        more = torch.from_numpy(added.standard_normal(x.shape).astype(np.float32)) if eta else None
        # Where the sample is clipped the noise goes with it, as in ours.
        x = schedule.step(
            said, step, x, eta=eta, use_clipped_model_output=True, variance_noise=more
        ).prev_sample
    return x.numpy()


@pytest.mark.parametrize("prediction", ["epsilon", "sample"])
@pytest.mark.parametrize(("steps", "eta"), [(5, 0.0), (10, 0.0), (100, 0.0), (100, 1.0)])
def test_it_is_what_diffusers_does(prediction, steps, eta):
    ours = ddim_sample(
        network, NOISE, STEPS, prediction, Sampler(steps, eta), np.random.default_rng(7)
    )
    np.testing.assert_allclose(ours, theirs(prediction, steps, eta), atol=2e-4)


def test_the_schedule_is_that_of_training():
    schedule = diffusers.DDPMScheduler(STEPS, beta_schedule="squaredcos_cap_v2")
    np.testing.assert_allclose(alphas_cumprod(STEPS), schedule.alphas_cumprod.numpy(), rtol=1e-4)


def test_a_network_that_knows_the_answer_is_believed():
    truth = np.clip(TABLE[:3], -1, 1)
    for steps in (1, 7, 100):
        found = ddim_sample(
            lambda noisy, step: truth,
            NOISE,
            STEPS,
            "sample",
            Sampler(steps),
            np.random.default_rng(),
        )
        np.testing.assert_allclose(found, truth, atol=1e-6)


@pytest.mark.parametrize("prediction", ["epsilon", "sample"])
def test_more_steps_than_the_diffusion_has_are_as_many(prediction):
    few = 10
    asked = []

    def heard(noisy, step):
        asked.append(int(step[0]))
        return network(noisy, step)

    most, all_of_them = (
        ddim_sample(heard, NOISE, few, prediction, Sampler(steps), np.random.default_rng())
        for steps in (100, few)
    )
    np.testing.assert_array_equal(most, all_of_them)
    assert asked == [*range(few - 1, -1, -1)] * 2
