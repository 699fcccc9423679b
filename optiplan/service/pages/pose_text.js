"use strict";
// Poses of the scene as edits of the text: in the frame and in the notation that the file has; what stays is not written.
const PoseText = (() => {
  const THREE = MeshCat.THREE, DEGREE = Math.PI / 180, SURFACE_GAP = 0.01; // m between a surface and the goal on it
  // What is dragged is written to 1 mm, 1e-4 rad and 0.01°; what is typed, as it is typed, but for what computing adds. `still`: less is no change.
  const DRAGGED = { metre: 1e-3, radian: 1e-4, degree: 0.01, unit: 1e-6, still: 1e-6, turn: 1e-4 }, TYPED = { metre: 1e-9, radian: 1e-7, degree: 1e-5, unit: 1e-9, still: 1e-9, turn: 1e-6 };
  const round = (x, step) => Math.round(x / step) * step;

  // A pose [x, y, z, qx, qy, qz, qw] as a matrix; a quaternion of a file is of length 1 only to its few digits.
  const matrix = (pose) => new THREE.Matrix4().compose(new THREE.Vector3(...pose), new THREE.Quaternion(...pose.slice(3)).normalize(), new THREE.Vector3(1, 1, 1));

  function pose(matrix) {
    const position = new THREE.Vector3(), quaternion = new THREE.Quaternion();
    matrix.decompose(position, quaternion, new THREE.Vector3());
    return [...position.toArray(), ...quaternion.toArray()];
  }

  // Angles about the fixed axes x, y, z of a quaternion, rad.
  function angles(quaternion) {
    const { x, y, z } = new THREE.Euler().setFromQuaternion(new THREE.Quaternion(...quaternion), "ZYX");
    return [x, y, z];
  }

  function fromAngles(rpy) { return new THREE.Quaternion().setFromEuler(new THREE.Euler(...rpy, "ZYX")).toArray(); }

  // What the file says of a pose, as [x, y, z, qx, qy, qz, qw] in its own frame.
  function read(said = {}) {
    const { position = [0, 0, 0], rpy, rpy_deg, quaternion } = said || {};
    return [...position, ...(quaternion || (rpy ? fromAngles(rpy) : rpy_deg ? fromAngles(rpy_deg.map((x) => x * DEGREE)) : [0, 0, 0, 1]))];
  }

  const turned = (a, b) => 2 * Math.acos(Math.min(1, Math.abs(a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3]) / (Math.hypot(...a) * Math.hypot(...b))));

  // New numbers to a step; those that are as before stay to the last digit.
  const changed = (before, fresh, step, still) => fresh.map((x, k) => (Math.abs(x - before[k]) < still ? before[k] : round(x, step)));

  // What a pose of the file becomes when it moves in the world from X_WB to Y_WB: {position, rpy, ...}, only what changes.
  function moved(said, X_WB, Y_WB, to) {
    const own = read(said), offset = said && said.offset ? matrix(read(said.offset)) : new THREE.Matrix4();
    const X_WF = matrix(X_WB).multiply(offset.clone().invert()).multiply(matrix(own).invert());
    const fresh = pose(X_WF.invert().multiply(matrix(Y_WB)).multiply(offset.invert())), wish = {};
    const shifted = changed(own, fresh.slice(0, 3), to.metre, to.still);
    if (shifted.some((x, k) => x !== own[k])) wish.position = shifted;
    if (turned(own.slice(3), fresh.slice(3)) > to.turn) {
      const { quaternion, rpy_deg, rpy = [0, 0, 0] } = said || {}, turn = angles(fresh.slice(3));
      if (quaternion) wish.quaternion = fresh.slice(3).map((x) => round(x, to.unit));
      else if (rpy_deg) wish.rpy_deg = changed(rpy_deg, turn.map((x) => x / DEGREE), to.degree, to.still / DEGREE);
      else wish.rpy = changed(rpy, turn, to.radian, to.still);
    }
    return wish;
  }

  // Edits of the pose at `path` of the text, to the digits of what is dragged or typed.
  function edits(text, path, X_WB, Y_WB, to = DRAGGED) {
    const wish = moved(ProblemText.value(text, path), X_WB, Y_WB, to);
    return Object.keys(wish).length ? ProblemText.set(text, path, wish) : [];
  }

  // A pose of the world as the file would say it anew.
  const said = (X_WB, to = DRAGGED) => ({ position: X_WB.slice(0, 3).map((x) => round(x, to.metre)), rpy: angles(X_WB.slice(3)).map((x) => round(x, to.radian)) });

  // The pose `before` on a surface: 1 cm above it, the z axis into it; the turn about it is as near as can be to that of before.
  function onSurface(point, normal, before) {
    const n = new THREE.Vector3(...normal).normalize(), turned = new THREE.Quaternion(...before.slice(3)), z = new THREE.Vector3(0, 0, 1).applyQuaternion(turned);
    const q = new THREE.Quaternion().setFromUnitVectors(z, n.clone().negate()).multiply(turned);
    return [...point.map((x, k) => x + SURFACE_GAP * n.getComponent(k)), ...q.toArray()];
  }
  return { read, edits, said, onSurface, angles, fromAngles, round, TYPED };
})();
