"""A .glb put at a time of its animation, or in a pose: the State that `evaluate` takes."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from garmentc.errors import GarmentcError
from garmentc.gltf.glb_asset import GlbAsset, PoseKeyNetwork
from garmentc.gltf.sampling import sample
from garmentc.gltf.skeletons import SKELETONS, skeleton_of
from garmentc.gltf.state import State, rest_state, world_matrices
from garmentc.rig import ENCODING_GRAVITY_JOINTS, ENCODING_WIDTHS
from garmentc.smpl.rotations import axis_angle_to_quaternion, quaternion_to_axis_angle
from garmentc.smpl.skeleton import JOINT_COUNT, JOINT_NAMES


def animation_number(asset: GlbAsset, wanted: str) -> int:
    """The animation that a user means: by its name or, failing that, its number, counting from 0.

    Raises GarmentcError where there is no such animation.
    """
    names = [entry.name for entry in asset.animations]
    if not names:
        raise GarmentcError("has no animation; compile it with --motion", asset.path)
    if wanted in names:
        return names.index(wanted)
    if wanted.isdecimal() and int(wanted) < len(names):
        return int(wanted)
    raise GarmentcError(f"has no animation '{wanted}'; it has {', '.join(names)}", asset.path)


def state_at_time(asset: GlbAsset, seconds: float, animation: int = 0) -> State:
    """The nodes at a time of an animation; before its start and after its end it stands still.

    Raises GarmentcError where there is no such animation.
    """
    if not 0 <= animation < len(asset.animations):
        raise GarmentcError(f"has {len(asset.animations)} animations; there is no number {animation}", asset.path)
    state = rest_state(asset)
    for channel in asset.animations[animation].channels:
        value = sample(channel, seconds)
        if channel.path == "weights":
            state.weights[channel.node] = value
        else:
            getattr(state, channel.path)[channel.node] = value
    return state


def state_at_pose(
    asset: GlbAsset,
    pose: NDArray[Any],
    translation: NDArray[Any] | None = None,
    keys: NDArray[Any] | None = None,
) -> State:
    """The nodes with the 24 SMPL joints in a pose, and the morph weights that the pose-key network gives for it.

    pose         (24, 3) axis-angle, radians
    translation  (3,) metres, added to the rest position of the pelvis
    keys         (M,) morph weights of every outfit, instead of its network's
    Raises GarmentcError where the file has no such joints, or a network that is not understood.
    """
    state = rest_state(asset)
    joints = smpl_joints(asset)
    state.rotation[joints] = axis_angle_to_quaternion(np.asarray(pose, dtype=np.float64).reshape(JOINT_COUNT, 3))
    if translation is not None:
        state.translation[joints[0]] += np.asarray(translation, dtype=np.float64)
    for index in asset.mesh_nodes:
        network = pose_key_network(asset, index)
        if keys is not None and not asset.nodes[index].is_body:
            amounts = np.asarray(keys, dtype=np.float64)
        elif network is not None:
            amounts = _for_all_targets(evaluate_network(asset, network, state), len(state.weights[index]))
        else:
            continue
        if amounts.shape != state.weights[index].shape:
            raise GarmentcError(f"has {len(state.weights[index])} morph targets, not {len(amounts)}", asset.path)
        state.weights[index] = amounts
    return state


def _for_all_targets(keys: NDArray[np.float64], count: int) -> NDArray[np.float64]:
    """The network's keys, and 0 for the targets after those, which are left to animations."""
    return np.pad(keys, (0, max(0, count - len(keys))))


def smpl_joints(asset: GlbAsset) -> list[int]:
    """Nodes of the 24 SMPL joints, found by their names in any of SKELETONS.

    Raises GarmentcError where the file has no such joints.
    """
    by_name = {node.name: index for index, node in enumerate(asset.nodes)}
    for skin in asset.skins:
        if skeleton_of(tuple(asset.nodes[joint].name for joint in skin.joints)):
            return list(skin.joints)
    for skeleton in SKELETONS.values():
        if all(name in by_name for name in skeleton.joints):
            return [by_name[name] for name in skeleton.joints]
    missing = next(name for name in JOINT_NAMES if name not in by_name)
    raise GarmentcError(f"has no joint named {missing}; only files with the SMPL joints can be posed", asset.path)


def placement(asset: GlbAsset) -> NDArray[np.float64]:
    """(4, 4): what places the whole figure, from the body's axes and origin to the scene: the node above the pelvis."""
    above = asset.nodes[smpl_joints(asset)[0]].parent
    return np.eye(4) if above is None else world_matrices(asset, rest_state(asset))[above]


def pose_key_network(asset: GlbAsset, mesh_node: int) -> PoseKeyNetwork | None:
    """The network that drives a mesh node: the extension's, or else the copy in the node's extras."""
    node = asset.nodes[mesh_node]
    if node.mesh is not None and asset.meshes[node.mesh].pose_keys is not None:
        return asset.meshes[node.mesh].pose_keys
    return node.pose_keys


def evaluate_network(asset: GlbAsset, network: PoseKeyNetwork, state: State) -> NDArray[np.float64]:
    """Weights (K,) of the first K morph targets for the joint rotations of `state`.

    docs/GARMENTC_mesh_pose_keys.md, step by step.
    """
    if network.encoding not in ENCODING_WIDTHS:
        raise GarmentcError(f"has pose keys with the encoding {network.encoding}; update garmentc", asset.path)
    joints = list(network.joints)
    up = world_matrices(asset, state)[joints][:, 1, :3]  # row y: the world's up, seen from the joint
    gravity = up / np.linalg.norm(up, axis=1, keepdims=True) - np.array([0.0, 1.0, 0.0])
    others = quaternion_to_axis_angle(state.rotation[joints[1:]])
    if network.encoding == ENCODING_GRAVITY_JOINTS:
        others = np.concatenate([gravity[1:], others], axis=1)
    x = np.concatenate([gravity[0], others.reshape(-1)])
    inputs = network.layers[0].weight.shape[1]
    if len(x) != inputs:
        raise GarmentcError(f"has pose keys that take {inputs} inputs, not {len(x)}", asset.path)
    for layer in network.layers:
        x = layer(x)
    return x
