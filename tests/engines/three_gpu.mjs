// In a browser: where three.js's own shaders put every vertex, or a picture. See chromium.mjs.
//
// The vertex shader is made of the chunks that all of three's materials use for morphing and skinning. Every vertex is
// drawn as a point on a pixel of its own, and its world position is that pixel's colour, in 32-bit floats.

import * as THREE from 'three';
import {GLTFLoader} from 'three/addons/loaders/GLTFLoader.js';
import {MeshoptDecoder} from 'three/addons/libs/meshopt_decoder.module.js';

const VERTEX = `
  #include <common>
  #include <morphtarget_pars_vertex>
  #include <skinning_pars_vertex>
  uniform vec2 size;
  out vec3 world;
  void main() {
    #include <morphinstance_vertex>
    #include <begin_vertex>
    #include <morphtarget_vertex>
    #include <skinbase_vertex>
    #include <skinning_vertex>
    world = (modelMatrix * vec4(transformed, 1.0)).xyz;
    float id = float(gl_VertexID);
    vec2 pixel = vec2(mod(id, size.x), floor(id / size.x)) + 0.5;
    gl_Position = vec4(2.0 * pixel / size - 1.0, 0.0, 1.0);
    gl_PointSize = 1.0;
  }`;
const FRAGMENT = `
  in vec3 world;
  out vec4 color;
  void main() { color = vec4(world, 1.0); }`;
const WIDTH = 256;

const renderer = new THREE.WebGLRenderer({antialias: true, alpha: true, preserveDrawingBuffer: true});
if (!renderer.extensions.has('EXT_color_buffer_float')) throw new Error('this GPU draws no floats');
const loader = new GLTFLoader().setMeshoptDecoder(MeshoptDecoder);

const size = new THREE.Vector2();
const material = new THREE.ShaderMaterial({
  glslVersion: THREE.GLSL3, vertexShader: VERTEX, fragmentShader: FRAGMENT, uniforms: {size: {value: size}},
});

/** A function that reads where the mesh is now; and one that frees what it took. */
function positionReader(mesh) {
  const count = mesh.geometry.attributes.position.count, height = Math.ceil(count / WIDTH);
  const target = new THREE.WebGLRenderTarget(WIDTH, height, {
    type: THREE.FloatType, minFilter: THREE.NearestFilter, magFilter: THREE.NearestFilter, depthBuffer: false,
  });
  const points = new THREE.SkinnedMesh(mesh.geometry.clone().setIndex(null), material);
  Object.assign(points, {
    isMesh: false, isPoints: true, frustumCulled: false, matrixAutoUpdate: false,
    bindMode: mesh.bindMode, morphTargetInfluences: mesh.morphTargetInfluences,
  });
  points.bind(mesh.skeleton, mesh.bindMatrix);
  const scene = new THREE.Scene().add(points), camera = new THREE.PerspectiveCamera();
  const pixels = new Float32Array(4 * WIDTH * height);
  const read = () => {
    points.matrix.copy(mesh.matrixWorld);
    points.updateMatrixWorld(true);
    mesh.skeleton.update();
    size.set(WIDTH, height);
    material.uniformsNeedUpdate = true;
    renderer.setRenderTarget(target);
    renderer.setClearColor(0, 0);
    renderer.clear();
    renderer.render(scene, camera);
    renderer.readRenderTargetPixels(target, 0, 0, WIDTH, height, pixels);
    renderer.setRenderTarget(null);
    const positions = [];
    for (let i = 0; i < count; i++) {
      if (pixels[4 * i + 3] !== 1) throw new Error(`vertex ${i} was not drawn`);
      positions.push(pixels[4 * i], pixels[4 * i + 1], pixels[4 * i + 2]);
    }
    return positions;
  };
  return [read, () => { target.dispose(); points.geometry.dispose(); }];
}

function cameraOf({position, target, fov, width, height}) {
  const camera = new THREE.PerspectiveCamera(fov, width / height, 0.05, 50);
  camera.position.set(...position);
  camera.lookAt(...target);
  return camera;
}

/** A PNG with a transparent background. */
async function picture(loaded, view) {
  renderer.setSize(view.width, view.height);
  renderer.setClearColor(0, 0);
  const sky = new THREE.Scene(), scene = new THREE.Scene().add(loaded);
  sky.background = new THREE.Color(0.6, 0.6, 0.6);
  scene.environment = new THREE.PMREMGenerator(renderer).fromScene(sky).texture;
  const sun = new THREE.DirectionalLight(0xffffff, 2);
  sun.position.set(...view.sun);
  scene.add(sun);
  renderer.render(scene, cameraOf(view));
  return new Promise(resolve => renderer.domElement.toBlob(resolve, 'image/png'));
}

async function done(job, number) {
  const {scene, animations} = await loader.parseAsync(await (await fetch(`/glb/${number}`)).arrayBuffer(), '');
  const meshes = [];
  scene.traverse(object => { if (object.isSkinnedMesh) meshes.push(object); });
  for (const mesh of meshes) mesh.frustumCulled = false;
  const mixer = new THREE.AnimationMixer(scene);
  const action = animations.length ? mixer.clipAction(animations[0]) : null;
  action?.setLoop(THREE.LoopOnce, 1).play();
  if (action) action.clampWhenFinished = true;
  const pose = time => {
    action?.reset();
    mixer.setTime(time);
    scene.updateMatrixWorld(true);
  };
  try {
    if (job.view) {
      pose(job.time);
      return await picture(scene, job.view);
    }
    const readers = meshes.map(positionReader), positions = [];
    for (const time of job.times) {
      pose(time);
      for (const [read] of readers) for (const value of read()) positions.push(value);
    }
    for (const [, free] of readers) free();
    return Float64Array.from(positions);
  } finally {
    for (const mesh of meshes) mesh.geometry.dispose();
  }
}

const jobs = await (await fetch('/jobs')).json();
for (const [number, job] of jobs.entries()) {
  try {
    await fetch(`/out/${number}`, {method: 'POST', body: await done(job, number)});
  } catch (error) {
    await fetch(`/error/${number}`, {method: 'POST', body: String(error?.stack ?? error)});
  }
}
await fetch('/done', {method: 'POST'});
