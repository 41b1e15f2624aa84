"""DeePSD's network in torch against the formulas of the paper, written out plainly."""

from __future__ import annotations

import numpy as np
import pytest
from train_samples import SMALL_NETWORK

torch = pytest.importorskip("torch")

from garmentc.training import losses  # noqa: E402
from garmentc.training.deepsd_network import KEY_SCALE, Deepsd, DeepsdConfig  # noqa: E402
from garmentc.training.pose_encodings import POSE_ENCODINGS  # noqa: E402

N, T = 30, 7


def made(**variant: object) -> Deepsd:
    torch.manual_seed(1)
    network = Deepsd(DeepsdConfig(**SMALL_NETWORK, **variant)).double()  # type: ignore[arg-type]
    with torch.no_grad():
        for parameter in network.parameters():
            parameter.add_(0.1 * torch.randn_like(parameter))
    return network


def inputs() -> tuple[torch.Tensor, ...]:
    rng = np.random.default_rng(0)
    mean = rng.random((N, N)) * (rng.random((N, N)) < 0.2)
    mean /= np.maximum(mean.sum(axis=1, keepdims=True), 1)
    held, skin = rng.random((N, 2)), rng.dirichlet(np.ones(24), N)
    held[:5, 0], held[5:10, 0] = 1, 0
    return tuple(torch.from_numpy(x) for x in (rng.normal(size=(N, 3)), rng.normal(size=(N, 3)), mean, held, skin))


def features(network: Deepsd) -> torch.Tensor:
    return torch.from_numpy(np.random.default_rng(2).normal(size=(T, network.config.pose_features)))


def test_heads_see_local_and_global_descriptors_side_by_side() -> None:
    network = made(metadata_width=3)
    metadata = torch.tensor([0.0, 1.0, 0.5], dtype=torch.float64)
    descriptors = network.descriptors(*inputs(), metadata)
    local, shared, firmness, skin = descriptors
    everything = torch.cat([local, shared.expand(N, -1)], dim=1)
    pooled = torch.relu(network.global_layer(local)).amax(dim=0)
    torch.testing.assert_close(shared, torch.cat([pooled, metadata]))
    learned = torch.softmax(network.weight_head(everything), dim=1)
    torch.testing.assert_close(network.blend_weights(descriptors), firmness * skin + (1 - firmness) * learned)
    shapes = KEY_SCALE * (network.data_head(everything) + network.physics_head(everything))
    torch.testing.assert_close(network.blend_shapes(descriptors), ((1 - firmness) * shapes).reshape(N, -1, 3))


def test_cloth_that_the_skin_holds_has_its_weights_and_no_shapes() -> None:
    for variant in ({}, {"deformation": "vertices"}):
        network = made(**variant)
        descriptors = network.descriptors(*inputs())
        torch.testing.assert_close(network.blend_weights(descriptors)[:5], descriptors.skin[:5], rtol=0, atol=0)
        moved = network.deformations(descriptors, features(network)).abs().amax(dim=(0, 2))
        assert not moved[:5].any()
        assert (moved[5:] > 0).all()


def test_the_global_descriptor_has_the_gradient_of_a_maximum() -> None:
    network = made()
    wanted = torch.randn(12, dtype=torch.float64)
    parameters = [network.global_layer.weight, *network.convolutions.parameters()]
    whole = network.descriptors(*inputs())
    few = network.descriptors(*inputs(), rows=torch.tensor([2]))
    plain = torch.relu(network.global_layer(whole.local)).amax(dim=0)
    expected = torch.autograd.grad((plain * wanted).sum(), parameters, retain_graph=True)
    for ours in (whole, few):
        found = torch.autograd.grad((ours.shared * wanted).sum(), parameters, retain_graph=True)
        for a, b in zip(found, expected, strict=True):
            torch.testing.assert_close(a, b)


def test_rows_of_descriptors_are_those_of_the_whole() -> None:
    network, rows = made(), torch.tensor([3, 17, 4])
    whole, part = network.descriptors(*inputs()), network.descriptors(*inputs(), rows=rows)
    torch.testing.assert_close(part.local, whole.local[rows])
    torch.testing.assert_close(part.shared, whole.shared)
    torch.testing.assert_close(network.blend_shapes(part), network.blend_shapes(whole)[rows])


@pytest.mark.parametrize("variant", [{}, {"pose_embedding": False}, {"pose_encoding": "gravity_6d"}])
def test_blend_shapes_deform_by_keys_relative_to_rest(variant: dict[str, object]) -> None:
    network = made(**variant)
    descriptors, poses = network.descriptors(*inputs()), features(network)
    keys = network.absolute_keys(poses) - network.absolute_keys(torch.zeros_like(poses[:1]))
    expected = torch.einsum("tp,npc->tnc", keys, network.blend_shapes(descriptors))
    torch.testing.assert_close(network.deformations(descriptors, poses), expected)
    assert not network.deformations(descriptors, torch.zeros_like(poses)).any()


@pytest.mark.parametrize("encoding", sorted(POSE_ENCODINGS))
def test_keys_are_blind_to_ignored_joints_and_nothing_else(encoding: str) -> None:
    from garmentc.training.export_deepsd import key_network

    network = made(ignored_joints=(15, 22), pose_encoding=encoding).float()
    poses = np.random.default_rng(4).normal(0, 0.4, (3, 24, 3))
    poses[1] = poses[2] = poses[0]
    poses[1, [15, 22]] += 0.3
    poses[2, 16] += 0.3
    encoded = torch.from_numpy(POSE_ENCODINGS[encoding].encode(poses).astype(np.float32))
    keys = network.absolute_keys(encoded)
    torch.testing.assert_close(keys[1], keys[0])
    assert (keys[2] - keys[0]).abs().max() > 1e-3
    first = key_network(network).layers[0].weight
    torch.testing.assert_close(
        torch.from_numpy(first @ encoded[1].numpy()), torch.from_numpy(first @ encoded[0].numpy())
    )


def test_the_baseline_sees_descriptor_and_pose_side_by_side() -> None:
    network = made(deformation="vertices")
    descriptors, poses = network.descriptors(*inputs()), features(network)
    keys = KEY_SCALE * network.pose_keys(poses)
    rows = [torch.cat([descriptors.local, descriptors.shared.expand(N, -1), key.expand(N, -1)], dim=1) for key in keys]
    torch.testing.assert_close(
        network.deformations(descriptors, poses), (1 - descriptors.firmness) * network.data_head(torch.stack(rows))
    )


def test_skinning_alone_has_nothing_else() -> None:
    network = made(deformation="none", global_descriptor=False)
    names = {name.split(".")[0] for name, _ in network.named_parameters()}
    assert names == {"convolutions", "weight_head"}
    assert not network.deformations(network.descriptors(*inputs()), features(network)).any()


def test_untrained_physics_adds_nothing() -> None:
    network = Deepsd(DeepsdConfig(**SMALL_NETWORK)).double()
    descriptors = network.descriptors(*inputs())
    assert not network.blend_shapes(descriptors, data=False).any()
    assert network.blend_shapes(descriptors, physics=False).any()


@pytest.mark.parametrize("name", POSE_ENCODINGS)
def test_encodings_are_zero_at_rest_and_tell_poses_apart(name: str) -> None:
    encoding = POSE_ENCODINGS[name]
    assert encoding.encode(np.zeros((2, 24, 3))).shape == (2, encoding.width)
    assert not encoding.encode(np.zeros((2, 24, 3))).any()
    for joint in range(24):
        pose = np.zeros((24, 3))
        pose[joint, 0] = 0.3
        assert np.abs(encoding.encode(pose)).max() > 0.04


@pytest.mark.parametrize("name", [name for name in POSE_ENCODINGS if name.startswith("gravity")])
def test_encodings_with_gravity_are_blind_to_heading(name: str) -> None:
    from scipy.spatial.transform import Rotation

    pose = 0.3 * np.random.default_rng(4).normal(size=(24, 3))
    turned = pose.copy()
    turned[0] = (Rotation.from_rotvec([0, 1.3, 0]) * Rotation.from_rotvec(pose[0])).as_rotvec()
    np.testing.assert_allclose(POSE_ENCODINGS[name].encode(turned), POSE_ENCODINGS[name].encode(pose), atol=1e-12)


def test_physics_losses_of_a_ball_over_a_ball() -> None:
    """A sphere of 100 mm, 3 mm above one of 97 mm: no stretch, 2 mm short of 5 mm, and 10 mm away none."""
    import trimesh

    ball = trimesh.creation.icosphere(4, 1.0)
    normals = torch.from_numpy(ball.vertices.copy())[None]
    triangles = torch.from_numpy(ball.faces.copy()).long()
    edges = torch.from_numpy(ball.edges_unique.copy()).long()
    cloth = 0.1 * normals
    rest = losses.edge_lengths(cloth, edges)[0]
    assert losses.edge_loss(losses.edge_lengths(cloth, edges), rest) == 0
    longer = losses.edge_loss(losses.edge_lengths(1.02 * cloth, edges), rest)
    torch.testing.assert_close(longer, (0.02 * rest * 1000).square().mean())
    torch.testing.assert_close(losses.collision_loss(cloth, 0.097 * normals, normals, 0.005).item(), 4.0)
    assert losses.collision_loss(cloth, 0.09 * normals, normals, 0.005) == 0
    torch.testing.assert_close(losses.vertex_normals(cloth, triangles), normals, atol=1e-2, rtol=0)
    flat = cloth * torch.tensor([1.0, 1.0, 0.0])
    counts = torch.bincount(edges.flatten()).double()
    bent = losses.bend_loss(losses.vertex_normals(cloth, triangles), edges, counts)
    assert losses.bend_loss(torch.ones_like(flat), edges, counts) == 0 < bent


def test_largest_weights_keep_their_proportions() -> None:
    weights = torch.tensor([[0.5, 0.1, 0.3, 0.1], [0.25, 0.25, 0.5, 0.0]])
    torch.testing.assert_close(losses.largest(weights, 2)[0], torch.tensor([0.625, 0.0, 0.375, 0.0]))
    torch.testing.assert_close(losses.largest(weights, 2).sum(dim=1), torch.ones(2))
    assert losses.largest(weights, 4) is weights
