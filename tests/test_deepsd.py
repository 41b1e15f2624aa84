"""DeePSD: the exported graphs against torch, pieces against the whole, and what a bundle's reader refuses."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path

import numpy as np
import pytest

from garmentc.errors import GarmentcError
from garmentc.families import deepsd
from garmentc.families.bundle import MANIFEST, load_bundle
from garmentc.families.held_cloth import HeldCloth
from garmentc.rig import encode_pose
from garmentc.smpl.default_body import load_default_body
from garmentc.smpl.pose_sampler import sample_poses

torch = pytest.importorskip("torch")


@pytest.fixture(scope="module")
def network():
    from garmentc.training.deepsd_network import Deepsd

    torch.manual_seed(3)
    made = Deepsd()
    with torch.no_grad():
        for parameter in made.parameters():  # biases too, or a forgotten bias would not show
            parameter.add_(0.01 * torch.randn_like(parameter))
    return made


@pytest.fixture(scope="module")
def bundle_path(network, tmp_path_factory) -> Path:
    from garmentc.training.write_bundle import write_bundle

    path = tmp_path_factory.mktemp("bundle")
    write_bundle(network, path, version="0", description="test", training={})
    return path


@pytest.fixture(scope="module")
def outfit():
    """The default body's own surface serves as an outfit: closed, curved, uneven."""
    body = load_default_body("female")
    triangles = body.faces
    edges = np.unique(np.sort(triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1), axis=0).astype(np.int32)
    normals = body.v_template / np.linalg.norm(body.v_template, axis=1, keepdims=True)
    rng = np.random.default_rng(7)
    firmness, held, skin = rng.random(len(normals)), rng.random(len(normals)), rng.dirichlet(np.ones(24), len(normals))
    cloth = HeldCloth(*(array.astype(np.float32) for array in (firmness, held, skin)))
    return body.v_template, normals, triangles, edges, body.joints(), cloth


def torch_result(network, outfit):
    vertices, normals, _, edges, _, cloth = outfit
    count = len(vertices)
    mean = torch.zeros(count, count, dtype=torch.float64)
    mean[edges[:, 0], edges[:, 1]] = 1
    mean[edges[:, 1], edges[:, 0]] = 1
    mean /= mean.sum(dim=1, keepdim=True).clamp(min=1)
    exact = type(network)(network.config)
    exact.load_state_dict(network.state_dict())
    exact = exact.double()
    with torch.no_grad():
        held = torch.from_numpy(np.column_stack([cloth.firmness, cloth.held]).astype(np.float64))
        skin = torch.from_numpy(cloth.skin.astype(np.float64))
        descriptors = exact.descriptors(torch.from_numpy(vertices), torch.from_numpy(normals), mean, held, skin)
        shapes = exact.blend_shapes(descriptors).numpy().transpose(1, 0, 2)
        return exact.blend_weights(descriptors).numpy(), shapes


def test_exported_outfit_graph_equals_torch_in_double_precision(network, bundle_path, outfit):
    weights, shapes = torch_result(network, outfit)
    rig = deepsd.infer(load_bundle(bundle_path), *outfit)
    np.testing.assert_allclose(rig.weights, weights, atol=1e-5)
    np.testing.assert_allclose(rig.blend_shapes, shapes, atol=1e-5)
    np.testing.assert_allclose(rig.weights.sum(axis=1), 1, atol=1e-6)


def test_exported_keys_graph_and_numpy_keys_equal_torch(network, bundle_path):
    import onnxruntime

    bundle = load_bundle(bundle_path)
    poses = sample_poses(50, seed=5)
    poses[0] = 0
    poses[1, 4] = [0, 4.0, 0]  # the long way round: 4 rad is -2.28 rad
    exact = type(network)(network.config)
    exact.load_state_dict(network.state_dict())
    with torch.no_grad():
        expected = exact.double().pose_keys(torch.from_numpy(encode_pose(poses))).numpy()
    session = onnxruntime.InferenceSession(bundle.keys)
    found = session.run(None, {"pose": poses.astype(np.float32)})[0]
    np.testing.assert_allclose(found, expected, atol=1e-5)
    np.testing.assert_allclose(bundle.network(poses), expected, atol=1e-6)
    assert np.abs(bundle.network(np.zeros((24, 3)))).max() < 1e-7


def test_keys_do_not_depend_on_heading_but_on_tilt(bundle_path):
    from scipy.spatial.transform import Rotation

    network = load_bundle(bundle_path).network
    pose = sample_poses(1, seed=9)[0]
    root = Rotation.from_rotvec(pose[0])
    turned, tilted = pose.copy(), pose.copy()
    turned[0] = (Rotation.from_rotvec([0, 1.1, 0]) * root).as_rotvec()
    tilted[0] = (Rotation.from_rotvec([0.6, 0, 0]) * root).as_rotvec()
    np.testing.assert_allclose(network(turned), network(pose), atol=1e-9)
    assert np.abs(network(tilted) - network(pose)).max() > 1e-4


def test_an_outfit_taken_in_pieces_gives_the_same_rig(bundle_path, outfit, monkeypatch):
    bundle = load_bundle(bundle_path)
    whole = deepsd.infer(bundle, *outfit)
    monkeypatch.setattr(deepsd, "MAX_GATHERED", 20_000)
    monkeypatch.setattr(deepsd, "MAX_DECODED", 1000)
    pieces = deepsd.infer(bundle, *outfit)
    np.testing.assert_allclose(pieces.weights, whole.weights, atol=1e-6)
    np.testing.assert_allclose(pieces.blend_shapes, whole.blend_shapes, atol=2e-6)


def test_vertex_order_does_not_matter(bundle_path, outfit):
    vertices, normals, triangles, edges, joints, cloth = outfit
    bundle = load_bundle(bundle_path)
    straight = deepsd.infer(bundle, *outfit)
    order = np.random.default_rng(0).permutation(len(vertices))
    place = np.argsort(order).astype(np.int32)
    other = HeldCloth(cloth.firmness[order], cloth.held[order], cloth.skin[order])
    shuffled = deepsd.infer(bundle, vertices[order], normals[order], place[triangles], place[edges], joints, other)
    np.testing.assert_allclose(shuffled.weights, straight.weights[order], atol=1e-6)
    np.testing.assert_allclose(shuffled.blend_shapes, straight.blend_shapes[:, order], atol=1e-5)


def changed_copy(bundle_path: Path, folder: Path, part: str, change) -> Path:
    """A copy of the bundle whose `part` graph went through `change`, hashes made to fit."""
    import onnx

    folder.mkdir(parents=True, exist_ok=True)
    manifest = json.loads((bundle_path / MANIFEST).read_text())
    for name in ("outfit.onnx", "keys.onnx"):
        (folder / name).write_bytes((bundle_path / name).read_bytes())
    model = onnx.load(bundle_path / f"{part}.onnx")
    change(model)
    data = model.SerializeToString()
    (folder / f"{part}.onnx").write_bytes(data)
    manifest["files"][part]["sha256"] = hashlib.sha256(data).hexdigest()
    (folder / MANIFEST).write_text(json.dumps(manifest))
    return folder


def test_keys_that_are_not_nought_at_rest_are_refused(bundle_path, tmp_path):
    from onnx import numpy_helper

    from garmentc.key_graph import REST_KEYS

    def shift(model):
        tensor = next(tensor for tensor in model.graph.initializer if tensor.name == REST_KEYS)
        rest = numpy_helper.to_array(tensor) + np.float32(0.01)
        tensor.CopyFrom(numpy_helper.from_array(rest, REST_KEYS))

    with pytest.raises(GarmentcError, match="not what the keys are at rest; export it again"):
        load_bundle(changed_copy(bundle_path, tmp_path, "keys", shift))


def test_external_data_is_refused(bundle_path, tmp_path):
    from onnx import TensorProto

    def outside(model):
        tensor = model.graph.initializer[0]
        tensor.data_location = TensorProto.EXTERNAL
        entry = tensor.external_data.add()
        entry.key, entry.value = "location", "/etc/passwd"

    with pytest.raises(GarmentcError, match="another file"):
        load_bundle(changed_copy(bundle_path, tmp_path, "outfit", outside))


def test_foreign_operators_are_refused(bundle_path, tmp_path):
    def foreign(model):
        model.opset_import.add().domain = "evil.corp"

    with pytest.raises(GarmentcError, match=r"evil\.corp"):
        load_bundle(changed_copy(bundle_path, tmp_path, "keys", foreign))


def test_missing_graph_input_is_named(bundle_path, tmp_path, outfit):
    def rename(model):
        for value in model.graph.input:
            if value.name == "neighbors":
                value.name = "edges"
        for node in model.graph.node:
            node.input[:] = ["edges" if name == "neighbors" else name for name in node.input]

    bundle = load_bundle(changed_copy(bundle_path, tmp_path, "outfit", rename))
    with pytest.raises(GarmentcError, match="neighbors"):
        deepsd.infer(bundle, *outfit)


@pytest.mark.parametrize(("value", "tensor"), [(np.nan, "weights"), (np.inf, "blend_shapes")])
def test_a_network_that_makes_no_numbers_is_refused(bundle_path, tmp_path, outfit, value, tensor):
    def spoil(model):
        """Add `value` to the first number of an output."""
        from onnx import TensorProto, helper

        output = next(output for output in model.graph.output if output.name == tensor)
        for node in model.graph.node:
            node.output[:] = [f"{tensor}_sound" if name == output.name else name for name in node.output]
        model.graph.initializer.append(helper.make_tensor("spoil", TensorProto.FLOAT, [1], [value]))
        model.graph.node.append(helper.make_node("Add", [f"{tensor}_sound", "spoil"], [tensor]))

    bundle = load_bundle(changed_copy(bundle_path, tmp_path, "outfit", spoil))
    with pytest.raises(GarmentcError, match=f"'{tensor}' that are NaN or infinite; train the bundle again") as error:
        deepsd.infer(bundle, *outfit)
    assert str(error.value).startswith(str(tmp_path))


def test_changed_file_is_refused(bundle_path, tmp_path):
    folder = changed_copy(bundle_path, tmp_path, "keys", lambda model: None)
    data = bytearray((folder / "keys.onnx").read_bytes())
    data[len(data) // 2] ^= 1
    (folder / "keys.onnx").write_bytes(bytes(data))
    with pytest.raises(GarmentcError, match="changed since"):
        load_bundle(folder)


@pytest.mark.parametrize(
    ("key", "value", "message"),
    [
        ("family", "other", "family"),
        ("pose_encoding", "six_d", "pose_encoding"),
        ("files", {"outfit": {"name": "../outfit.onnx", "sha256": "0" * 64}, "keys": {}}, "name|keys"),
        ("key_layers", [{"weight": "nothing", "bias": "pose_head.0.bias", "activation": "relu"}], "nothing"),
    ],
)
def test_wrong_manifest_is_refused(bundle_path, tmp_path, key, value, message):
    folder = changed_copy(bundle_path, tmp_path, "keys", lambda model: None)
    manifest = json.loads((folder / MANIFEST).read_text())
    manifest[key] = value
    (folder / MANIFEST).write_text(json.dumps(manifest))
    with pytest.raises(GarmentcError, match=message):
        load_bundle(folder)


def test_missing_and_broken_manifest(tmp_path):
    with pytest.raises(GarmentcError, match="no such file"):
        load_bundle(tmp_path)
    (tmp_path / MANIFEST).write_text('{"schema": 1,\n oops}')
    with pytest.raises(GarmentcError, match=r"manifest\.json:2: "):
        load_bundle(tmp_path)
