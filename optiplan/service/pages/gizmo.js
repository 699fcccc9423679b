"use strict";
// What moves, turns and resizes the selected obstacle: a frame at it, and a knob at each end of its shape.
const Gizmo = (() => {
  const THREE = MeshCat.THREE, LEAST = 0.005; // m: no side gets smaller
  const skin = new THREE.MeshBasicMaterial({ color: 0xd9822b, depthTest: false, transparent: true, opacity: 0.95 });

  // The ends of a shape that a knob pulls: where, along which axis, and the shape when that end moves by `by`, m.
  // `moves`: whether its middle goes half the way along, so that the other end stays.
  function ends(shape) {
    const [kind] = Object.keys(shape), of = shape[kind], axes = [[1, 0, 0], [0, 1, 0], [0, 0, 1]];
    const least = (x) => Math.max(LEAST, x);
    if (kind === "box") return axes.flatMap((axis, k) => [1, -1].map((sign) => ({ axis: axis.map((x) => sign * x), at: axis.map((x) => 0.5 * sign * x * of[k]), moves: true,
      pulled: (by) => ({ box: of.map((x, j) => (j === k ? least(x + by) : x)) }) })));
    if (kind === "sphere") return axes.map((axis) => ({ axis, at: axis.map((x) => x * of), moves: false, pulled: (by) => ({ sphere: least(of + by) }) }));
    if (kind !== "cylinder" && kind !== "capsule") return [];
    const tip = 0.5 * of.length + (kind === "capsule" ? of.radius : 0);
    return [...[1, -1].map((sign) => ({ axis: [0, 0, sign], at: [0, 0, sign * tip], moves: true, pulled: (by) => ({ [kind]: { ...of, length: least(of.length + by) } }) })),
      ...axes.slice(0, 2).map((axis) => ({ axis, at: axis.map((x) => x * of.radius), moves: false, pulled: (by) => ({ [kind]: { ...of, radius: least(of.radius + by) } }) }))];
  }

  // Knobs of a shape in its own frame; their `userData.end` says what they pull.
  function knobs(shape) {
    const group = new THREE.Group();
    for (const end of ends(shape)) {
      const knob = new THREE.Mesh(new THREE.SphereGeometry(0.012, 16, 12), skin);
      knob.position.set(...end.at);
      knob.renderOrder = 10;
      knob.userData.end = end;
      group.add(knob);
    }
    return group;
  }

  // A drag of a knob: called with rays, it returns the pull along its axis, m; null where the view runs along the axis.
  function pull(knob, rays, camera) {
    const at = knob.getWorldPosition(new THREE.Vector3()), axis = new THREE.Vector3(...knob.userData.end.axis).applyQuaternion(knob.getWorldQuaternion(new THREE.Quaternion()));
    const sight = camera.getWorldDirection(new THREE.Vector3()), normal = sight.clone().addScaledVector(axis, -sight.dot(axis)).normalize();
    const plane = new THREE.Plane().setFromNormalAndCoplanarPoint(normal, at), begin = rays.ray.intersectPlane(plane, new THREE.Vector3());
    return begin && ((now) => {
      const hit = now.ray.intersectPlane(plane, new THREE.Vector3());
      return hit ? hit.sub(begin).dot(axis) : null;
    });
  }
  return { knobs, pull };
})();
