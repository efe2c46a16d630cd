"""Training the posterior: simulated rovers in, a network that returns a mixture of Gaussians out (neural posterior).

The network sees each wheel through the same layers, averages over the wheels that were measured, and returns ten
parameters for each of eight components. It is trained to give the true soils of simulated rovers the highest density,
which makes it the Bayesian posterior under the prior of `soils` and `rovers`, as far as the features of `window` carry.
"""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import jax
import jax.numpy as jnp
import numpy as np
import onnx
import optax
from numpy.typing import NDArray
from onnx import TensorProto, helper, numpy_helper

from regolithd.calibration.parameters import Drivetrain, Wheel
from regolithd.calibration.posterior import simulated_rovers as rover_simulation
from regolithd.calibration.posterior.mixture import PARAMETERS, TARGETS
from regolithd.calibration.posterior.window import FEATURES, KNOWN, Windows, reduce_windows

if TYPE_CHECKING:
    from collections.abc import Callable

Array = NDArray[np.float64]
Parameters = dict[str, Any]

COMPONENTS = 8
WIDTH = 96
INSTANTS = {1: 0.2, 2: 0.06, 4: 0.07, 8: 0.1, 20: 0.47, 40: 0.1}
"""How many instants a window has, and the share of the training set that has so many."""

_CHUNK = 4000


@dataclass(frozen=True, slots=True, eq=False)
class Examples:
    """Windows and the truth behind them: log c, φ [rad] and drawbar margin, shape (N, 3)."""

    windows: Windows
    truth: Array


def simulate(count: int, rng: np.random.Generator, progress: Callable[[int], None] = lambda _: None) -> Examples:
    """Return `count` windows of rovers as they can be, some with wheels that were not measured."""
    parts = []
    for instants, share in INSTANTS.items():
        left = round(count * share)
        while left > 0:
            size = min(left, _CHUNK)
            parts.append(_simulate_chunk(size, instants, rng))
            left -= size
            progress(size)
    windows = Windows(
        np.concatenate([part.windows.wheels for part in parts]),
        np.concatenate([part.windows.mask for part in parts]),
        np.concatenate([part.windows.known for part in parts]),
    )
    return Examples(windows, np.concatenate([part.truth for part in parts]))


def _simulate_chunk(count: int, instants: int, rng: np.random.Generator) -> Examples:
    wheel = Wheel()
    rovers = rover_simulation.draw_rovers(count, rng)
    noise = rover_simulation.draw_noise(count, rng)
    measured = rover_simulation.drive(rovers, noise, instants, rng, Drivetrain(), wheel)
    known = rovers.known.copy()
    known[:, 3] = rover_simulation.told_scatter(rovers, noise, Drivetrain().gain_Nm_per_A, rng)
    told = np.where(rng.random(count) < 0.5, rovers.nearest, -1)
    load = np.where(_measured_wheels(count, instants, rng)[:, None], measured.load_N, np.nan)
    windows = reduce_windows(load, measured.slip, measured.torque_Nm, known, wheel.radius_m, told)
    truth = np.column_stack(
        [
            np.log(rovers.soils.cohesion_Pa),
            np.radians(rovers.soils.friction_angle_deg),
            rover_simulation.margins(rovers, wheel),
        ]
    )
    return Examples(windows, truth)


def _measured_wheels(count: int, instants: int, rng: np.random.Generator) -> NDArray[np.bool_]:
    """Return which wheels were measured: mostly all six, else some, at least one; at one instant, often just one."""
    shares = [0.4, 0.15, 0.45] if instants == 1 else [0.75, 0.15, 0.1]
    share = rng.choice([1.0, 0.75, 0.0], size=(count, 1), p=shares)
    measured = rng.random((count, 6)) < share
    measured[np.arange(count), rng.integers(6, size=count)] = True
    return measured


def initial(rng: np.random.Generator, components: int = COMPONENTS) -> Parameters:
    """Return initial weights."""

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


def apply(parameters: Parameters, wheels: jax.Array, mask: jax.Array, known: jax.Array) -> jax.Array:
    """Return the raw output, shape (N, 10 K), for standardised features."""

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
class Scaling:
    """What standardises features and targets: mean and standard deviation of each over the training set."""

    wheels: tuple[Array, Array]
    known: tuple[Array, Array]
    truth: tuple[Array, Array]


def scaling(examples: Examples) -> Scaling:
    """Return the scaling of a training set."""
    present = examples.windows.wheels[examples.windows.mask > 0]
    known, truth = examples.windows.known, examples.truth
    return Scaling(
        (present.mean(axis=0), present.std(axis=0)),
        (known.mean(axis=0), known.std(axis=0)),
        (truth.mean(axis=0), truth.std(axis=0)),
    )


def fit(
    examples: Examples, seed: int, steps: int, batch: int = 1024, progress: Callable[[float], None] = lambda _: None
) -> tuple[Parameters, Scaling]:
    """Return the weights after `steps` of Adam with a cosine decay; `progress` is told the loss every 50 steps."""
    by = scaling(examples)
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
    parameters = initial(np.random.default_rng(seed))
    optimiser = optax.chain(
        optax.clip_by_global_norm(1.0),
        optax.adam(optax.warmup_cosine_decay_schedule(0.0, 2e-3, min(300, steps // 10), steps)),
    )
    state = optimiser.init(parameters)

    def loss(parameters: Parameters, rows: jax.Array) -> jax.Array:
        wheels, mask, known, truth = (values[rows] for values in data)
        return negative_log_density(apply(parameters, wheels, mask, known), truth)

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


def freeze(parameters: Parameters, by: Scaling, radius_m: float) -> onnx.ModelProto:
    """Return the network as ONNX: wheels (N, 6, 7), mask (N, 6), known (N, 10) → mixture (N, 10 K)."""
    constants = {
        "wheels_mean": by.wheels[0],
        "wheels_std": by.wheels[1],
        "known_mean": by.known[0],
        "known_std": by.known[1],
        "six": np.array(6.0),
        "ones": np.ones((1, 6, 1)),
        **{f"{name}_{part}": np.asarray(value) for name, layer in parameters.items() for part, value in layer.items()},
    }
    initializers = [numpy_helper.from_array(value.astype(np.float32), name) for name, value in constants.items()]
    initializers += [numpy_helper.from_array(np.array([1]), "one"), numpy_helper.from_array(np.array([2]), "two")]
    make = helper.make_node
    nodes = [
        make("Sub", ["wheels", "wheels_mean"], ["wheels_0"]),
        make("Div", ["wheels_0", "wheels_std"], ["wheels_1"]),
        make("Sub", ["known", "known_mean"], ["known_0"]),
        make("Div", ["known_0", "known_std"], ["known_1"]),
        make("Unsqueeze", ["known_1", "one"], ["known_2"]),
        make("Mul", ["known_2", "ones"], ["known_3"]),
        make("Concat", ["wheels_1", "known_3"], ["each"], axis=-1),
        *_dense("wheel1", "each", "hidden_1"),
        *_dense("wheel2", "hidden_1", "hidden_2"),
        make("Unsqueeze", ["mask", "two"], ["mask_1"]),
        make("Mul", ["hidden_2", "mask_1"], ["hidden_3"]),
        make("ReduceSum", ["hidden_3", "one"], ["summed"], keepdims=0),
        make("ReduceSum", ["mask", "one"], ["count"], keepdims=1),
        make("Div", ["summed", "count"], ["mean"]),
        make("Div", ["count", "six"], ["count_1"]),
        make("Concat", ["mean", "known_1", "count_1"], ["pooled"], axis=-1),
        *_dense("rover1", "pooled", "hidden_4"),
        *_dense("rover2", "hidden_4", "hidden_5"),
        make("MatMul", ["hidden_5", "out_w"], ["out_0"]),
        make("Add", ["out_0", "out_b"], ["mixture"]),
    ]
    shapes: dict[str, list[str | int | None]] = {"wheels": ["N", 6, FEATURES], "mask": ["N", 6], "known": ["N", KNOWN]}
    width = int(parameters["out"]["b"].size)
    graph = helper.make_graph(
        nodes,
        "posterior",
        [helper.make_tensor_value_info(name, TensorProto.FLOAT, shape) for name, shape in shapes.items()],
        [helper.make_tensor_value_info("mixture", TensorProto.FLOAT, ["N", width])],
        initializers,
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], producer_name="regolithd")
    model.ir_version = 9
    digest = hashlib.sha256(b"".join(np.asarray(layer["w"]).tobytes() for layer in parameters.values())).hexdigest()
    helper.set_model_props(
        model,
        {
            "regolithd.version": f"posterior-{digest[:12]}",
            "regolithd.radius_m": repr(radius_m),
            "regolithd.targets": json.dumps(
                [
                    {"name": name, "centre": float(centre), "unit": float(unit)}
                    for name, centre, unit in zip(TARGETS, *by.truth, strict=True)
                ]
            ),
        },
    )
    onnx.checker.check_model(model)
    return model


def _dense(layer: str, source: str, out: str) -> list[onnx.NodeProto]:
    """Return the nodes of one layer with the activation x · sigmoid(x)."""
    return [
        helper.make_node("MatMul", [source, f"{layer}_w"], [f"{out}_product"]),
        helper.make_node("Add", [f"{out}_product", f"{layer}_b"], [f"{out}_net"]),
        helper.make_node("Sigmoid", [f"{out}_net"], [f"{out}_gate"]),
        helper.make_node("Mul", [f"{out}_net", f"{out}_gate"], [out]),
    ]
