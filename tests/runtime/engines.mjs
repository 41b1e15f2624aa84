// three.js and Babylon.js from the packages of tests/engines, each told to load a file, take a pose, and be driven.

import fs from 'node:fs';

globalThis.self = globalThis; // the loaders of both ask for it

const installed = path => import(new URL(`../engines/node_modules/${path}`, import.meta.url));

/** A file's bytes in an ArrayBuffer of their own. */
function bytesOf(path) {
  const bytes = fs.readFileSync(path);
  return bytes.buffer.slice(bytes.byteOffset, bytes.byteOffset + bytes.byteLength);
}

/**
 * A loaded file in three.js.
 * @returns drivers; `pose` sets quaternions (24 × x y z w); `weights` reads each mesh's, `leave` sets them; `turn` turns
 *   all of it
 */
export async function inThree(glb) {
  globalThis.createImageBitmap = async () => ({width: 1, height: 1, close() {}}); // textures are not looked at
  const {load, THREE, loader} = await three();
  const {findPoseKeys} = await import('../../examples/runtime/three_adapter.js');
  const gltf = await load(loader, bytesOf(glb));
  const drivers = await findPoseKeys(gltf);
  return {
    gltf,
    drivers,
    THREE,
    pose: (rotations, joints = drivers[0].joints) =>
      joints.forEach((joint, i) => joint.quaternion.fromArray(rotations, 4 * i)),
    weights: (driver = drivers[0]) => driver.meshes.map(mesh => [...mesh.morphTargetInfluences]),
    leave: (weight, driver) => driver.meshes.forEach(mesh => mesh.morphTargetInfluences.fill(weight)),
    turn: ([x, y, z, w], scale) => {
      gltf.scene.quaternion.set(x, y, z, w);
      gltf.scene.scale.setScalar(scale);
    },
  };
}

async function three() {
  const [THREE, {GLTFLoader}, {MeshoptDecoder}] = await Promise.all(
    ['three/build/three.module.js', 'three/examples/jsm/loaders/GLTFLoader.js',
      'three/examples/jsm/libs/meshopt_decoder.module.js'].map(installed));
  const loader = new GLTFLoader().setMeshoptDecoder(MeshoptDecoder);
  return {THREE, loader, load: (loader, bytes) => loader.parseAsync(bytes, '')};
}

/** The same in Babylon.js; `leftHanded` is Babylon's own default. */
export async function inBabylon(glb, {leftHanded = true} = {}) {
  const {engine, core, ImportMeshAsync, registerGLTFExtension} = await babylon();
  const {findPoseKeys, registerPoseKeys} = await import('../../examples/runtime/babylon_adapter.js');
  registerPoseKeys(registerGLTFExtension);
  const scene = new core.Scene(engine);
  scene.useRightHandedSystem = !leftHanded;
  const loaded = await ImportMeshAsync(new Uint8Array(bytesOf(glb)), scene, {pluginExtension: '.glb', name: 'a.glb'});
  loaded.animationGroups.forEach(group => group.stop());
  const drivers = findPoseKeys(loaded);
  return {
    loaded,
    scene,
    drivers,
    pose: (rotations, joints = drivers[0].joints) => joints.forEach((joint, i) =>
      joint.rotationQuaternion.copyFromFloats(...rotations.slice(4 * i, 4 * i + 4))),
    weights: (driver = drivers[0]) => driver.meshes.map(({morphTargetManager: targets}) =>
      Array.from({length: targets.numTargets}, (_, i) => targets.getTarget(i).influence)),
    leave: (weight, driver) => driver.meshes.forEach(({morphTargetManager: targets}) => {
      for (let i = 0; i < targets.numTargets; i++) targets.getTarget(i).influence = weight;
    }),
    turn: ([x, y, z, w], scale) => {
      const above = new core.TransformNode('above', scene);
      above.rotationQuaternion = new core.Quaternion(x, y, z, w);
      above.scaling.setAll(scale);
      loaded.meshes[0].parent = above; // Babylon's root of the file, which mirrors it where the scene is left-handed
    },
  };
}

let loadedBabylon;
function babylon() {
  return loadedBabylon ??= (async () => {
    const names = 'Engines/nullEngine scene Maths/math.vector Meshes/transformNode Loading/sceneLoader Misc/logger';
    const modules = await Promise.all(names.split(' ').map(name => installed(`@babylonjs/core/${name}.js`)));
    await Promise.all(['Animations/animatable', 'Bones/skeleton'].map(name => installed(`@babylonjs/core/${name}.js`)));
    const {registerGLTFExtension} = await installed('@babylonjs/loaders/glTF/2.0/index.js');
    const all = Object.assign({}, ...modules);
    all.Logger.LogLevels = all.Logger.ErrorLogLevel;
    return {engine: new all.NullEngine(), core: all, ImportMeshAsync: all.ImportMeshAsync, registerGLTFExtension};
  })();
}
