// A page to look at a compiled garment: plays its clip with baked morph weights, or has the network drive them, live,
// while the clip plays or joints are dragged. `?url=a.glb` opens a file at once. `window.viewer` is for tests.

import * as THREE from 'three';
import {OrbitControls} from 'three/addons/controls/OrbitControls.js';
import {RoomEnvironment} from 'three/addons/environments/RoomEnvironment.js';
import {MeshoptDecoder} from 'three/addons/libs/meshopt_decoder.module.js';
import {GLTFLoader} from 'three/addons/loaders/GLTFLoader.js';
import {JointHandles} from './joint_handles.js';
import {findPoseKeys} from './three_adapter.js';

const page = Object.fromEntries(['message', 'bar', 'file', 'play', 'time', 'live', 'joints', 'rest']
  .map(id => [id, document.getElementById(id)]));

const renderer = new THREE.WebGLRenderer({antialias: true});
renderer.toneMapping = THREE.NeutralToneMapping;
renderer.setPixelRatio(devicePixelRatio);
document.body.prepend(renderer.domElement);
const scene = new THREE.Scene();
scene.background = new THREE.Color(0xd9dcdf);
scene.environment = new THREE.PMREMGenerator(renderer).fromScene(new RoomEnvironment(), 0.04).texture;
scene.environmentIntensity = 0.6;
const sun = new THREE.DirectionalLight(0xffffff, 1.8);
sun.position.set(1, 2, 2);
scene.add(sun);
const camera = new THREE.PerspectiveCamera(35, 1, 0.01, 100);
const orbit = new OrbitControls(camera, renderer.domElement);
const handles = new JointHandles(camera, renderer.domElement);
scene.add(handles.points);

/** What is open: the loaded scene, its drivers, bones at rest, and the first clip if there is one. */
let shown = null, playing = false, asked = null;
const clock = new THREE.Clock();

async function open(bytes) {
  const gltf = await new GLTFLoader().setMeshoptDecoder(MeshoptDecoder).parseAsync(bytes, '');
  const drivers = await findPoseKeys(gltf);
  if (shown) scene.remove(shown.scene);
  const bones = new Set();
  gltf.scene.traverse(object => {
    if (!object.isSkinnedMesh) return;
    object.frustumCulled = false; // its bounds are those at rest
    object.skeleton.bones.forEach(bone => bones.add(bone));
  });
  const mixer = new THREE.AnimationMixer(gltf.scene), [clip] = gltf.animations;
  const rest = [...bones].map(bone => ({bone, quaternion: bone.quaternion.clone()}));
  shown = {scene: gltf.scene, drivers, mixer, clip, rest};
  scene.add(gltf.scene);
  if (clip) mixer.clipAction(clip).play();
  handles.show([...bones]);
  page.play.disabled = page.time.disabled = !clip;
  page.time.max = clip?.duration ?? 0;
  page.rest.disabled = false;
  page.live.disabled = !drivers.length;
  page.live.checked = page.joints.checked = drivers.length > 0 && !clip;
  page.message.textContent = drivers.length ? '' : 'This file carries no pose-key network.';
  play(false);
  seek(0);
  frame(gltf.scene);
}

/** Put the whole figure into the picture. */
function frame(object) {
  object.updateMatrixWorld(true);
  object.traverse(each => each.skeleton?.update());
  const box = new THREE.Box3().setFromObject(object), size = box.getSize(new THREE.Vector3()).length();
  box.getCenter(orbit.target);
  camera.position.copy(orbit.target).add(new THREE.Vector3(0.25, 0.1, 1).multiplyScalar(1.4 * size));
  orbit.update();
}

function play(on) {
  playing = on;
  clock.getDelta(); // time starts now
  redraw();
  page.play.textContent = on ? 'Pause' : 'Play';
}

/** Take the clip's pose and baked weights at a time. */
function seek(seconds) {
  redraw();
  if (!shown.clip) return;
  page.time.value = seconds;
  shown.mixer.setTime(Math.min(seconds, shown.clip.duration - 1e-6)); // the end is the start again, in a loop
  for (const {evaluator} of shown.drivers) evaluator.reset(); // the pose jumps
}

function restPose() {
  play(false);
  for (const {bone, quaternion} of shown.rest) bone.quaternion.copy(quaternion);
  page.live.checked = shown.drivers.length > 0;
}

function draw(seconds) {
  if (playing) {
    shown.mixer.update(seconds);
    page.time.value = shown.mixer.time % shown.clip.duration;
  }
  if (shown && page.live.checked) for (const driver of shown.drivers) driver.update(seconds);
  handles.points.visible = page.joints.checked;
  handles.update();
  renderer.render(scene, camera);
}

/** Draw soon; once, however often it is asked for. */
function redraw() {
  asked ??= requestAnimationFrame(() => {
    asked = null;
    draw(clock.getDelta());
    if (playing) redraw();
  });
}

function resize() {
  const height = innerHeight - page.bar.offsetHeight;
  renderer.setSize(innerWidth, height);
  camera.aspect = innerWidth / height;
  camera.updateProjectionMatrix();
  redraw();
}

async function openFile(file) {
  try {
    await open(await file.arrayBuffer());
  } catch (error) {
    page.message.textContent = `${file.name ?? 'The file'} cannot be shown: ${error.message}`;
  }
}

page.file.onchange = () => openFile(page.file.files[0]);
page.play.onclick = () => play(!playing);
page.time.oninput = () => { play(false); seek(Number(page.time.value)); };
page.rest.onclick = restPose;
handles.onDrag = redraw;
handles.onGrab = grabbed => {
  orbit.enabled = !grabbed;
  if (grabbed) {
    play(false);
    page.live.checked = shown.drivers.length > 0;
  }
};
addEventListener('dragover', event => event.preventDefault());
addEventListener('drop', event => { event.preventDefault(); openFile(event.dataTransfer.files[0]); });
addEventListener('resize', resize);
orbit.addEventListener('change', redraw);
page.live.onchange = page.joints.onchange = redraw;
resize();

window.viewer = {
  seek,
  draw,
  /** Weights of each garment's first mesh. */
  weights: () => shown.drivers.map(({meshes}) => [...meshes[0].morphTargetInfluences]),
  /** No morphs at all. */
  clear: () => shown.drivers.forEach(({meshes}) => meshes.forEach(mesh => mesh.morphTargetInfluences.fill(0))),
  rotations: () => shown.drivers[0].joints.map(joint => joint.quaternion.toArray()),
  jointOnPage: name => handles.onPage(handles.joints.find(joint => joint.name === name)),
};
const url = new URLSearchParams(location.search).get('url');
if (url) openFile(await fetch(url).then(response => response.blob()));
