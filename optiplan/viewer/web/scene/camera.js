"use strict";
// Where the camera stands: framing by the motion, from the side on which least hides it; in three.js's axes (y up).
const OptiPlanCamera = (() => {
  const THREE = MeshCat.THREE;
  const AROUND = [[-40, 24], [40, 24], [-75, 24], [75, 24], [-40, 45], [40, 45], [-110, 26], [110, 26], [-130, 26], [130, 26], [-150, 32], [150, 32]];
  const LOWEST = 2; // degrees above the floor's plane
  const rays = new THREE.Raycaster();

  function toward(azimuth, elevation) {
    const a = (azimuth * Math.PI) / 180, e = (elevation * Math.PI) / 180;
    return new THREE.Vector3(Math.cos(a) * Math.cos(e), Math.sin(e), -Math.sin(a) * Math.cos(e));
  }

  // Whether something of `solid` lies between the eye and a point, but for the last `skip` metres.
  function hidden(eye, point, solid, skip = 0) {
    const ray = point.clone().sub(eye), length = ray.length();
    rays.near = 0;
    rays.far = Math.max(0, length - skip);
    rays.set(eye, ray.normalize());
    return rays.intersectObjects(solid, false);
  }

  // The meshes whose boxes a ray from the eye to a point goes through, but for its last `skip` metres; quick.
  const inverse = new THREE.Matrix4(), own = new THREE.Ray(), inside = new THREE.Vector3();
  function boxesBetween(eye, point, meshes, skip) {
    const end = point.clone().lerp(eye, skip / Math.max(skip, eye.distanceTo(point)));
    return meshes.filter((mesh) => {
      if (!mesh.geometry.boundingBox) mesh.geometry.computeBoundingBox();
      inverse.copy(mesh.matrixWorld).invert();
      own.origin.copy(eye).applyMatrix4(inverse);
      own.direction.copy(end).applyMatrix4(inverse).sub(own.origin);
      const length = own.direction.length();
      own.direction.normalize();
      return own.intersectBox(mesh.geometry.boundingBox, inside) !== null && inside.distanceTo(own.origin) < length;
    });
  }

  // How far away a box (its corners) fills the picture, seen from a direction.
  function distance(camera, box, direction) {
    const centre = box.getCenter(new THREE.Vector3()), right = new THREE.Vector3(0, 1, 0).cross(direction).normalize(), up = direction.clone().cross(right);
    const tall = Math.tan((camera.fov * Math.PI) / 360), wide = tall * camera.aspect;
    let far = 0.1;
    for (let k = 0; k < 8; k++) {
      const corner = new THREE.Vector3(k & 1 ? box.max.x : box.min.x, k & 2 ? box.max.y : box.min.y, k & 4 ? box.max.z : box.min.z).sub(centre);
      far = Math.max(far, corner.dot(direction) + Math.max(Math.abs(corner.dot(right)) / wide, Math.abs(corner.dot(up)) / tall));
    }
    return 1.04 * far;
  }

  // Of some directions around, the one from which obstacles hide least of the points `targets`.
  function bestDirection(camera, box, targets, solid) {
    const centre = box.getCenter(new THREE.Vector3());
    let best = null, least = Infinity;
    for (const [azimuth, elevation] of AROUND) {
      const direction = toward(azimuth, elevation), eye = centre.clone().addScaledVector(direction, distance(camera, box, direction));
      const count = targets.filter((target) => hidden(eye, target, solid).length).length;
      if (count < least - 0.5) { least = count; best = direction; }
    }
    return best;
  }

  // The open side of a point: the direction in which the fewest bodies stand before it, near to that of the first view.
  function openSide(point, far, meshes, first) {
    const found = [];
    for (const elevation of [18, 35, 55, 8, 75]) {
      for (let azimuth = 0; azimuth < 360; azimuth += 15) {
        const direction = toward(azimuth, elevation), eye = point.clone().addScaledVector(direction, far), between = boxesBetween(eye, point, meshes, 0.01);
        const taste = 0.12 * (1 - direction.dot(first)) + 0.004 * Math.abs(elevation - 30);
        found.push({ direction, eye, between, taste, cost: between.length + taste });
      }
    }
    found.sort((a, b) => a.cost - b.cost); // boxes are larger than what is in them: the best are looked at closely
    for (const one of found.slice(0, 24)) one.exact = new Set(hidden(one.eye, point, one.between, 0.004).map((hit) => hit.object)).size + one.taste;
    return found.slice(0, 24).sort((a, b) => a.exact - b.exact)[0].direction;
  }

  function look(viewer, target, direction, far) {
    viewer.camera.position.copy(target).addScaledVector(direction, far);
    viewer.controls.target.copy(target);
    viewer.controls.maxPolarAngle = Math.PI / 2 - (LOWEST * Math.PI) / 180;
    viewer.controls.update();
    viewer.set_dirty();
  }

  return { hidden, boxesBetween, distance, bestDirection, openSide, look };
})();
