"use strict";
// Turns the shapes, colours and poses of a page's data into those of three.js; lengths in metres, in the frame of the shape.
const OptiPlanShapes = (() => {
  const THREE = MeshCat.THREE, { vertices, indices } = OptiPlanPacked;
  const CREASE = 0.87; // rad: sharper edges than that stay edges

  // Smooth shading within `crease` radians, sharp edges beyond: normals are averaged over near-parallel neighbours only,
  // whichever way these are wound: meshes of robots are often sheets back to back, or wound at random.
  function creased(points, faces, crease) {
    const count = faces.length / 3, normals = new Float32Array(faces.length), around = new Map();
    const a = new THREE.Vector3(), b = new THREE.Vector3(), c = new THREE.Vector3();
    for (let f = 0; f < count; f++) {
      a.fromArray(points, 3 * faces[3 * f]);
      b.fromArray(points, 3 * faces[3 * f + 1]).sub(a);
      c.fromArray(points, 3 * faces[3 * f + 2]).sub(a);
      b.cross(c).toArray(normals, 3 * f); // length: twice the area, the weight of the average
      for (let k = 0; k < 3; k++) {
        const v = faces[3 * f + k];
        if (around.has(v)) around.get(v).push(f); else around.set(v, [f]);
      }
    }
    const position = new Float32Array(3 * faces.length), normal = new Float32Array(3 * faces.length);
    const limit = Math.cos(crease);
    for (let i = 0; i < faces.length; i++) {
      a.fromArray(normals, 3 * Math.floor(i / 3));
      const size = a.length() || 1;
      c.set(0, 0, 0);
      for (const f of around.get(faces[i])) {
        b.fromArray(normals, 3 * f);
        const along = a.dot(b);
        if (Math.abs(along) >= limit * size * b.length()) c.addScaledVector(b, Math.sign(along) || 1);
      }
      c.normalize().toArray(normal, 3 * i);
      for (let k = 0; k < 3; k++) position[3 * i + k] = points[3 * faces[i] + k];
    }
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute("position", new THREE.BufferAttribute(position, 3));
    geometry.setAttribute("normal", new THREE.BufferAttribute(normal, 3));
    return geometry;
  }

  function capsule(radius, length) {
    const profile = [];
    for (let k = 0; k <= 24; k++) {
      const turn = -Math.PI / 2 + (Math.PI * k) / 24;
      profile.push(new THREE.Vector2(radius * Math.cos(turn), radius * Math.sin(turn) + (turn < 0 ? -0.5 : 0.5) * length));
      if (k === 12) profile.push(new THREE.Vector2(radius, -0.5 * length), new THREE.Vector2(radius, 0.5 * length));
    }
    profile.sort((p, q) => p.y - q.y);
    return new THREE.LatheGeometry(profile, 40).rotateX(Math.PI / 2);
  }

  function makeGeometry(shape) {
    switch (shape.kind) {
      case "box": return new THREE.BoxGeometry(...shape.size).translate(...(shape.centre || [0, 0, 0]));
      case "sphere": return new THREE.SphereGeometry(shape.radius, 40, 24);
      case "cylinder": return new THREE.CylinderGeometry(shape.radius, shape.radius, shape.length, 48).rotateX(Math.PI / 2);
      case "capsule": return capsule(shape.radius, shape.length);
      case "plane": return new THREE.PlaneGeometry(2, 2); // turned and sized by Scene.spreadPlane
      default: return creased(vertices(shape), indices(shape), CREASE);
    }
  }
  const rgb = ([r, g, b]) => new THREE.Color(r, g, b).convertSRGBToLinear();
  const named = (text) => new THREE.Color(text).convertSRGBToLinear();

  function place(object, pose, offset = 0) {
    object.position.fromArray(pose, offset);
    object.quaternion.fromArray(pose, offset + 3);
  }

  // Materials are shared by colour, so that a thousand obstacles cost one.
  function palette() {
    const known = new Map();
    return (key, make) => {
      if (!known.has(key)) known.set(key, make());
      return known.get(key);
    };
  }

  // Axes of a frame, `size` m long: x red, y green, z blue, each a rod with a tip.
  function triad(size) {
    const group = new THREE.Group(), thick = 0.035 * size;
    const rod = new THREE.CylinderGeometry(thick, thick, 0.8 * size, 12).translate(0, 0.4 * size, 0), tip = new THREE.ConeGeometry(2.4 * thick, 0.2 * size, 16).translate(0, 0.9 * size, 0);
    for (const [colour, turn] of [["#d3261f", [0, 0, -Math.PI / 2]], ["#2f9e5b", [0, 0, 0]], ["#2374c6", [Math.PI / 2, 0, 0]]]) {
      const look = new THREE.MeshStandardMaterial({ color: named(colour), roughness: 0.7 }), axis = new THREE.Group();
      axis.add(new THREE.Mesh(rod, look), new THREE.Mesh(tip, look));
      axis.rotation.set(...turn);
      group.add(axis);
    }
    return group;
  }

  // A goal region: its extent, and a ring about the axis that the frame may turn about as it likes.
  function region(one, colour) {
    const look = { color: named(colour), transparent: true, depthWrite: false };
    const box = new THREE.Mesh(new THREE.BoxGeometry(...one.size), new THREE.MeshBasicMaterial({ ...look, opacity: 0.18 }));
    box.add(new THREE.LineSegments(new THREE.EdgesGeometry(box.geometry), new THREE.LineBasicMaterial({ ...look, opacity: 0.8 })));
    place(box, one.pose);
    if (!one.ring) return [box];
    const ring = new THREE.Mesh(new THREE.TorusGeometry(one.ring.radius, 0.005, 8, 96), new THREE.MeshBasicMaterial({ ...look, opacity: 0.7 }));
    place(ring, one.ring.pose);
    return [box, ring];
  }

  // Puts an object where something at a pose is at a time, s, whose motion turns it and displaces it by polynomials.
  function placeInTime(object, pose, motion, t) {
    place(object, pose);
    if (!motion) return;
    const time = Math.min(t, motion.until === undefined ? Infinity : motion.until);
    const at = (row) => row.reduceRight((sum, c) => sum * time + c, 0);
    if (motion.turn) {
      const about = new THREE.Vector3(...motion.turn.about);
      const turned = new THREE.Quaternion().setFromAxisAngle(new THREE.Vector3(...motion.turn.axis), at(motion.turn.angle));
      object.position.sub(about).applyQuaternion(turned).add(about);
      object.quaternion.premultiply(turned);
    }
    object.position.add(new THREE.Vector3(...motion.polynomial.map(at)));
  }

  // Why a scene cannot be drawn, and what is here without it; but for a browser without WebGL it is an error of ours.
  function undrawn(error, rest) {
    const blind = !["webgl2", "webgl"].some((kind) => document.createElement("canvas").getContext(kind));
    if (!blind) console.error(error);
    return `The scene ${blind ? "needs WebGL, which this browser does not offer" : "cannot be drawn"}; ${rest} all the same. (${error.message})`;
  }

  return { undrawn, makeGeometry, rgb, named, place, placeInTime, palette, triad, region };
})();
