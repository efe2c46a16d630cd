"""Training of the posterior network: a mixture density network [1]_ fitted to simulated rovers (neural posterior).

The same two layers process each wheel, the results are averaged over the measured wheels, and two more layers return
ten parameters for each of eight Gaussian components. Minimising the negative log density of the true soils makes the
output approximate the Bayesian posterior under the prior of `terrain.soils` and `simulated_rovers`, given the features
of `window`.

References
----------
.. [1] C. M. Bishop, "Mixture density networks", Aston University, 1994.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import jax
import jax.numpy as jnp
import numpy as np
import optax
from numpy.typing import NDArray

from regolithd.calibration.posterior.mixture import PARAMETERS
from regolithd.calibration.posterior.window import FEATURES, KNOWN

if TYPE_CHECKING:
    from collections.abc import Callable

    from regolithd.calibration.posterior.training_examples import TrainingExamples

Array = NDArray[np.float64]
Parameters = dict[str, Any]

COMPONENTS = 8
"""Gaussians in the mixture."""
WIDTH = 96
"""Neurons in each hidden layer."""


def initial_parameters(rng: np.random.Generator, components: int = COMPONENTS) -> Parameters:
    """Return random initial weights and zero biases of all layers."""

    def layer(inputs: int, outputs: int, gain: float = 1.0) -> Parameters:
        weight = gain * rng.standard_normal((inputs, outputs)) / np.sqrt(inputs)
        return {"w": jnp.asarray(weight, jnp.float32), "b": jnp.zeros(outputs, jnp.float32)}

    return {
        "wheel1": layer(FEATURES + KNOWN, WIDTH),
        "wheel2": layer(WIDTH, WIDTH),
        "rover1": layer(WIDTH + KNOWN + 1, WIDTH),
        "rover2": layer(WIDTH, WIDTH),
        "out": layer(WIDTH, components * PARAMETERS, 0.3),
    }


def network_output(parameters: Parameters, wheels: jax.Array, mask: jax.Array, known: jax.Array) -> jax.Array:
    """Return the raw output, shape (N, 10 K), for standardised inputs (`window.Windows`)."""

    def dense(name: str, x: jax.Array) -> jax.Array:
        return x @ parameters[name]["w"] + parameters[name]["b"]

    each = jnp.broadcast_to(known[:, None], (*wheels.shape[:2], KNOWN))
    hidden = jax.nn.silu(dense("wheel1", jnp.concatenate([wheels, each], axis=-1)))
    hidden = jax.nn.silu(dense("wheel2", hidden)) * mask[..., None]
    count = mask.sum(axis=1, keepdims=True)
    pooled = jnp.concatenate([hidden.sum(axis=1) / count, known, count / 6], axis=-1)
    return dense("out", jax.nn.silu(dense("rover2", jax.nn.silu(dense("rover1", pooled)))))


def negative_log_density(raw: jax.Array, truth: jax.Array) -> jax.Array:
    """Return −log of the mixture's density at the standardised truth, averaged over the batch."""
    parts = raw.reshape(len(raw), -1, PARAMETERS)
    away = truth[:, None] - parts[..., 1:4]
    scale = jnp.exp(parts[..., 4:7])
    first = scale[..., 0] * away[..., 0]
    second = parts[..., 7] * away[..., 0] + scale[..., 1] * away[..., 1]
    third = parts[..., 8] * away[..., 0] + parts[..., 9] * away[..., 1] + scale[..., 2] * away[..., 2]
    log_density = parts[..., 4:7].sum(axis=-1) - 0.5 * (first**2 + second**2 + third**2)
    weight = jax.nn.log_softmax(parts[..., 0], axis=-1)
    return -jnp.mean(jax.nn.logsumexp(weight + log_density, axis=-1)) + 1.5 * jnp.log(2 * jnp.pi)


@dataclass(frozen=True, slots=True, eq=False)
class Standardisation:
    """Mean and standard deviation of features and targets over the training set."""

    wheels: tuple[Array, Array]
    known: tuple[Array, Array]
    truth: tuple[Array, Array]


def standardisation_of(examples: TrainingExamples) -> Standardisation:
    """Return mean and standard deviation of each feature and target of a training set."""
    present = examples.windows.wheels[examples.windows.mask > 0]
    known, truth = examples.windows.known, examples.truth
    return Standardisation(
        (present.mean(axis=0), present.std(axis=0)),
        (known.mean(axis=0), known.std(axis=0)),
        (truth.mean(axis=0), truth.std(axis=0)),
    )


def fit(
    examples: TrainingExamples,
    seed: int,
    steps: int,
    batch: int = 1024,
    progress: Callable[[float], None] = lambda _: None,
) -> tuple[Parameters, Standardisation]:
    """Return the weights after `steps` of Adam with cosine decay; `progress` is called with the loss every 50 steps."""
    by = standardisation_of(examples)
    windows = examples.windows
    data = tuple(
        jnp.asarray(values, jnp.float32)
        for values in (
            (windows.wheels - by.wheels[0]) / by.wheels[1],
            windows.mask,
            (windows.known - by.known[0]) / by.known[1],
            (examples.truth - by.truth[0]) / by.truth[1],
        )
    )
    parameters = initial_parameters(np.random.default_rng(seed))
    optimiser = optax.chain(
        optax.clip_by_global_norm(1.0),
        optax.adam(optax.warmup_cosine_decay_schedule(0.0, 2e-3, min(300, steps // 10), steps)),
    )
    state = optimiser.init(parameters)

    def loss(parameters: Parameters, rows: jax.Array) -> jax.Array:
        wheels, mask, known, truth = (values[rows] for values in data)
        return negative_log_density(network_output(parameters, wheels, mask, known), truth)

    def step(carry: tuple[Parameters, Any], key: jax.Array) -> tuple[tuple[Parameters, Any], jax.Array]:
        parameters, state = carry
        rows = jax.random.randint(key, (batch,), 0, len(examples.truth))
        value, gradient = jax.value_and_grad(loss)(parameters, rows)
        updates, state = optimiser.update(gradient, state, parameters)
        return (optax.apply_updates(parameters, updates), state), value

    fifty = jax.jit(lambda carry, keys: jax.lax.scan(step, carry, keys))
    carry = (parameters, state)
    for keys in jax.random.split(jax.random.key(seed), (max(steps // 50, 1), 50)):
        carry, losses = fifty(carry, keys)
        progress(float(losses.mean()))
    return carry[0], by
