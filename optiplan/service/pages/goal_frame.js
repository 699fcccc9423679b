"use strict";
// A frame that is dragged: its ball moves it in the plane of the screen, its arrows along an axis, its rings about one.
const GoalFrame = (() => {
  const THREE = MeshCat.THREE, COLOURS = [0xd3302f, 0x2e8b3d, 0x2374c6], LENGTH = 0.15, RADIUS = 0.11;
  const AXES = [new THREE.Vector3(1, 0, 0), new THREE.Vector3(0, 1, 0), new THREE.Vector3(0, 0, 1)], UP = AXES[1];

  const skin = (colour, opacity) => new THREE.MeshBasicMaterial({ color: colour, depthTest: false, depthWrite: false, transparent: true, opacity });

  function part(geometry, colour, kind, axis, opacity = 0.85) {
    const mesh = new THREE.Mesh(geometry, skin(colour, opacity));
    mesh.renderOrder = 9;
    mesh.userData = { kind, axis };
    return mesh;
  }

  const ball = (opacity) => part(new THREE.SphereGeometry(0.024, 24, 16), 0x2374c6, "ball", null, opacity);

  function make() {
    const frame = new THREE.Group();
    frame.ball = ball(0.85);
    frame.add(frame.ball);
    AXES.forEach((axis, k) => {
      const along = new THREE.Quaternion().setFromUnitVectors(UP, axis), about = new THREE.Quaternion().setFromUnitVectors(AXES[2], axis);
      const shaft = part(new THREE.CylinderGeometry(0.004, 0.004, LENGTH, 10), COLOURS[k], "arrow", axis), tip = part(new THREE.ConeGeometry(0.014, 0.04, 16), COLOURS[k], "arrow", axis);
      shaft.position.copy(axis).multiplyScalar(0.5 * LENGTH);
      tip.position.copy(axis).multiplyScalar(LENGTH + 0.02);
      const ring = part(new THREE.TorusGeometry(RADIUS, 0.0028, 8, 64), COLOURS[k], "ring", axis, 0.7), grip = part(new THREE.TorusGeometry(RADIUS, 0.013, 6, 40), COLOURS[k], "ring", axis, 0);
      for (const one of [shaft, tip]) one.quaternion.copy(along);
      for (const one of [ring, grip]) one.quaternion.copy(about);
      frame.add(shaft, tip, ring, grip);
    });
    return frame;
  }

  // The part of the frame that a ray meets, the ball before arrows before rings; null if it meets none.
  function met(frame, rays) {
    const found = rays.intersectObjects(frame.children), kinds = ["ball", "arrow", "ring"];
    found.sort((a, b) => kinds.indexOf(a.object.userData.kind) - kinds.indexOf(b.object.userData.kind) || a.distance - b.distance);
    return found.length ? found[0].object.userData : null;
  }

  // A drag of a part: called with rays, it moves the frame; null where the ray does not meet what it moves in.
  function drag(frame, { kind, axis }, rays, camera) {
    const at = frame.getWorldPosition(new THREE.Vector3()), sight = camera.getWorldDirection(new THREE.Vector3());
    const a = axis && axis.clone().applyQuaternion(frame.getWorldQuaternion(new THREE.Quaternion()));
    const normal = kind === "ball" ? sight : kind === "ring" ? a : sight.clone().addScaledVector(a, -sight.dot(a)).normalize();
    const plane = new THREE.Plane().setFromNormalAndCoplanarPoint(normal, at), begin = rays.ray.intersectPlane(plane, new THREE.Vector3());
    if (!begin) return null;
    const turned = frame.quaternion.clone(), first = begin.clone().sub(at).normalize(), hit = new THREE.Vector3();
    return (now) => {
      if (!now.ray.intersectPlane(plane, hit)) return false;
      const moved = hit.clone().sub(begin);
      if (kind === "ring") {
        const arm = hit.clone().sub(at).normalize();
        const angle = Math.atan2(first.clone().cross(arm).dot(a), first.dot(arm));
        frame.quaternion.copy(turned).multiply(new THREE.Quaternion().setFromAxisAngle(axis, angle));
      } else {
        if (kind === "arrow") moved.copy(a).multiplyScalar(hit.clone().sub(begin).dot(a));
        if (!frame.parent) return false; // the scene was drawn anew meanwhile, with another frame
        frame.position.copy(frame.parent.worldToLocal(at.clone().add(moved)));
      }
      return true;
    };
  }
  return { make, ball, met, drag };
})();
