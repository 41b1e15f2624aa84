// World positions in poses that are not in the file: joints set by hand, morph weights by the file's pose-key network,
// as docs/GARMENTC_mesh_pose_keys.md tells engine developers to do it.

import {eachJob, writePositions} from './jobs.mjs';
import {THREE, load, worldPositions} from './three_scene.mjs';

const floats = text => new Float32Array(Uint8Array.from(atob(text), c => c.charCodeAt(0)).buffer);

function axisAngle(q) {
  const sign = q.w < 0 ? -1 : 1, length = Math.hypot(q.x, q.y, q.z);
  const k = length < 1e-12 ? 2 * sign : sign * 2 * Math.atan2(length, sign * q.w) / length;
  return [q.x * k, q.y * k, q.z * k];
}

/** The file's network. Tools may have put the mesh into a new node below the one that it had: extras stay above. */
function networkOf(object) {
  const text = object.userData.GARMENTC_mesh_pose_keys;
  if (text) return JSON.parse(text);
  if (!object.parent) throw new Error('no node above the mesh has a pose-key network in its extras');
  return networkOf(object.parent);
}

function gravity(joint) {
  const up = new THREE.Vector3(0, 1, 0).applyQuaternion(joint.getWorldQuaternion(new THREE.Quaternion()).invert());
  return [up.x, up.y - 1, up.z];
}

function poseKeys({encoding}, layers, joints) {
  const felt = encoding === 'gravity_joints' ? gravity : () => [];
  let x = [...gravity(joints[0]), ...joints.slice(1).flatMap(j => [...felt(j), ...axisAngle(j.quaternion)])];
  for (const {weight, bias, activation} of layers) {
    const inputs = x;
    x = Array.from(bias, (b, o) => inputs.reduce((sum, value, i) => sum + weight[o * inputs.length + i] * value, b));
    if (activation.endsWith('relu')) x = x.map(value => Math.max(value, 0));
    if (activation === 'normalized_relu') {
      const sum = x.reduce((a, b) => a + b, 1e-6);
      x = x.map(value => value / sum);
    }
    if (activation === 'nonnegative') {
      const least = Math.min(...x);
      x = x.map(value => value - least);
    }
  }
  return x;
}

await eachJob(async ({glb, out, poses}) => {
  const {scene, meshes} = await load(glb);
  const network = networkOf(meshes[0]);
  const layers = network.layers.map(layer => ({...layer, weight: floats(layer.weight), bias: floats(layer.bias)}));
  const joints = network.joints.map(name => meshes[0].skeleton.getBoneByName(name));
  const positions = [];
  for (const {rotations, translation} of poses) {
    rotations.forEach((rotation, i) => {
      const vector = new THREE.Vector3(...rotation), angle = vector.length();
      joints[i].quaternion.setFromAxisAngle(angle ? vector.normalize() : vector.set(1, 0, 0), angle);
    });
    const rest = joints[0].userData.rest ??= joints[0].position.clone();
    joints[0].position.copy(rest).add(new THREE.Vector3(...translation));
    scene.updateMatrixWorld(true);
    const weights = poseKeys(network, layers, joints);
    for (const mesh of meshes) weights.forEach((weight, i) => { mesh.morphTargetInfluences[i] = weight; });
    for (const value of worldPositions(scene, meshes)) positions.push(value);
  }
  writePositions(out, positions);
});
