// Dots on the joints of a skeleton. Dragging one turns the bone above it, so that the dot follows the pointer.

import * as THREE from 'three';

const REACH = 14; // pixels around a dot that still grab it

export class JointHandles {
  /** Called with true when a joint is grabbed, with false when it is let go. */
  onGrab = grabbed => {};
  /** Called when a bone was turned. */
  onDrag = () => {};

  constructor(camera, canvas) {
    this.camera = camera;
    this.canvas = canvas;
    this.joints = [];
    this.grabbed = null;
    const material = new THREE.PointsMaterial({color: 0xd6006c, size: 9, sizeAttenuation: false, depthTest: false});
    this.points = new THREE.Points(new THREE.BufferGeometry(), material);
    this.points.frustumCulled = false;
    this.points.renderOrder = 1;
    // Before OrbitControls, which would turn the view.
    canvas.addEventListener('pointerdown', event => this.grab(event), {capture: true});
    canvas.addEventListener('pointermove', event => this.drag(event));
    canvas.addEventListener('pointerup', () => this.release());
  }

  /** Joints without a bone above them have no dot: nothing would turn. */
  show(bones) {
    this.joints = bones.filter(bone => bone.parent?.isBone);
    this.points.geometry.dispose();
    this.points.geometry = new THREE.BufferGeometry()
      .setAttribute('position', new THREE.BufferAttribute(new Float32Array(3 * this.joints.length), 3));
  }

  update() {
    if (!this.points.visible) return;
    const position = this.points.geometry.attributes.position, at = new THREE.Vector3();
    this.joints.forEach((joint, i) => position.setXYZ(i, ...joint.getWorldPosition(at)));
    position.needsUpdate = true;
  }

  /** Where a joint is on the page, in pixels. */
  onPage(joint) {
    const {left, top, width, height} = this.canvas.getBoundingClientRect();
    const {x, y} = joint.getWorldPosition(new THREE.Vector3()).project(this.camera);
    return {x: left + (x + 1) / 2 * width, y: top + (1 - y) / 2 * height};
  }

  grab(event) {
    if (!this.points.visible) return;
    const far = joint => Math.hypot(this.onPage(joint).x - event.clientX, this.onPage(joint).y - event.clientY);
    const [nearest] = this.joints.toSorted((a, b) => far(a) - far(b));
    if (!nearest || far(nearest) > REACH) return;
    this.grabbed = nearest;
    this.canvas.setPointerCapture(event.pointerId);
    this.onGrab(true);
  }

  drag(event) {
    if (!this.grabbed) return;
    const bone = this.grabbed.parent, pivot = bone.getWorldPosition(new THREE.Vector3());
    const from = this.grabbed.getWorldPosition(new THREE.Vector3());
    const to = this.pointed(event, from);
    if (!to) return;
    const turn = new THREE.Quaternion()
      .setFromUnitVectors(from.sub(pivot).normalize(), to.sub(pivot).normalize());
    // World turn to a turn of the bone in its parent's axes.
    const above = bone.parent.getWorldQuaternion(new THREE.Quaternion());
    bone.quaternion.premultiply(above).premultiply(turn).premultiply(above.invert()).normalize();
    this.onDrag();
  }

  /** The point under the pointer in the plane through `from` that faces the camera. */
  pointed(event, from) {
    const {left, top, width, height} = this.canvas.getBoundingClientRect();
    const at = new THREE.Vector2((event.clientX - left) / width * 2 - 1, 1 - (event.clientY - top) / height * 2);
    const ray = new THREE.Raycaster();
    ray.setFromCamera(at, this.camera);
    const facing = this.camera.getWorldDirection(new THREE.Vector3());
    return ray.ray.intersectPlane(new THREE.Plane().setFromNormalAndCoplanarPoint(facing, from), new THREE.Vector3());
  }

  release() {
    if (!this.grabbed) return;
    this.grabbed = null;
    this.onGrab(false);
  }
}
