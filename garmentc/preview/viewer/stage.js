// Camera, light and floor.

import {
  Box3, Color, DirectionalLight, Mesh, NeutralToneMapping, PCFShadowMap, PerspectiveCamera, PlaneGeometry, PMREMGenerator,
  RoomEnvironment, Scene, ShadowMaterial, OrbitControls, Vector3, WebGLRenderer,
} from 'three';

const DISTANCE = 3.7;

export class Stage {
  constructor(canvas) {
    this.canvas = canvas;
    this.renderer = new WebGLRenderer({canvas, antialias: true, preserveDrawingBuffer: true});
    this.renderer.setPixelRatio(Math.min(window.devicePixelRatio, 2));
    this.renderer.toneMapping = NeutralToneMapping;
    this.renderer.shadowMap.enabled = true;
    this.renderer.shadowMap.type = PCFShadowMap;

    this.scene = new Scene();
    const surroundings = new PMREMGenerator(this.renderer);
    this.scene.environment = surroundings.fromScene(new RoomEnvironment(), 0.04).texture;
    this.scene.environmentIntensity = 0.6;
    surroundings.dispose();

    this.camera = new PerspectiveCamera(34, 1, 0.05, 50);
    this.lamp = new DirectionalLight(0xffffff, 1.5);
    this.lamp.castShadow = true;
    this.lamp.shadow.mapSize.set(2048, 2048);
    this.lamp.shadow.radius = 4;
    this.lamp.shadow.normalBias = 0.012;
    Object.assign(this.lamp.shadow.camera, {left: -1.4, right: 1.4, top: 1.4, bottom: -1.4, near: 0.1, far: 8});
    this.scene.add(this.lamp, this.lamp.target);

    this.floor = new Mesh(new PlaneGeometry(12, 12), new ShadowMaterial());
    this.floor.rotation.x = -Math.PI / 2;
    this.floor.receiveShadow = true;
    this.scene.add(this.floor);

    this.controls = new OrbitControls(this.camera, canvas);
    this.controls.enableDamping = true;
    this.controls.dampingFactor = 0.12;
    this.controls.minDistance = 0.3;
    this.controls.maxDistance = 12;
    this.middle = new Vector3();
    this.place = null; // of the figure, when it was last seen
  }

  set theme(dark) {
    this.scene.background = new Color(dark ? 0x22252a : 0xeceef0);
    this.floor.material.opacity = dark ? 0.4 : 0.16;
  }

  /** Look at all of an object that stands on the ground. */
  frame(object, ground) {
    const box = new Box3().setFromObject(object, true);
    box.getCenter(this.middle);
    this.middle.y -= 0.05 * (box.max.y - box.min.y); // room for the timeline
    this.floor.position.y = this.ground = ground;
    this.distance = Math.max(1, (box.max.y - box.min.y) / 1.75) * DISTANCE;
    this.look(20);
  }

  /** Look from `degrees` to the left of the front. */
  look(degrees) {
    const angle = degrees * Math.PI / 180;
    const direction = new Vector3(Math.sin(angle), 0.12, Math.cos(angle)).normalize();
    this.controls.target.copy(this.middle);
    this.camera.position.copy(this.middle).addScaledVector(direction, this.distance);
    this.controls.update();
  }

  /** Keep camera, lamp and floor with a figure that walks; `place` is that of its pelvis in the world. */
  follow(place) {
    const step = this.place ? place.clone().sub(this.place).setY(0) : new Vector3();
    for (const point of [this.middle, this.controls.target, this.camera.position, this.floor.position]) point.add(step);
    this.place = place.clone();
    this.lamp.target.position.set(place.x, this.middle.y, place.z);
    this.lamp.position.copy(this.lamp.target.position).add(new Vector3(-1.3, 3.4, 2.2));
  }

  draw() {
    const {clientWidth: width, clientHeight: height} = this.canvas;
    const ratio = this.renderer.getPixelRatio();
    if (this.canvas.width !== Math.floor(width * ratio) || this.canvas.height !== Math.floor(height * ratio)) {
      this.renderer.setSize(width, height, false);
      this.camera.aspect = width / Math.max(height, 1);
      this.camera.fov = this.camera.aspect < 0.8 ? 34 * 0.8 / this.camera.aspect : 34;
      this.camera.updateProjectionMatrix();
    }
    this.controls.update();
    this.renderer.render(this.scene, this.camera);
  }
}
