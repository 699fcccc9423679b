"use strict";
// Tool paths of several runs: a colour each, and stripes of all colours where paths coincide.
const OptiPlanPaths = (() => {
  const THREE = MeshCat.THREE, { named } = OptiPlanShapes;
  const FIRST = ["#1769aa", "#d1701f", "#7b3fa0", "#2a8c5a", "#b8336a", "#6b7a0f"];
  const SAME = 4e-3; // m: the tube's radius; paths nearer than this look like one
  const SEGMENTS = 480, ROUNDS = 4; // of a tube, and how often each colour comes in a striped one

  // Beyond the first ones, hues by the golden angle in three tones: neighbours in the list never look alike.
  function runColour(k) {
    if (k < FIRST.length) return FIRST[k];
    return "#" + new THREE.Color().setHSL((0.07 + 0.618034 * k) % 1, [0.75, 0.9, 0.5][k % 3], [0.42, 0.28, 0.6][k % 3]).getHexString();
  }

  function smoothCurve(points) {
    const line = [], last = new THREE.Vector3(Infinity, 0, 0);
    for (let i = 0; i < points.length; i += 3) {
      const p = new THREE.Vector3().fromArray(points, i);
      if (p.distanceTo(last) > 2e-3) { line.push(p); last.copy(p); }
    }
    return line.length < 2 ? null : new THREE.CatmullRomCurve3(line);
  }

  // Member `part` of `parts` that share one path: every so many segments of the tube are its own.
  function tube(curve, colour, part, parts) {
    const geometry = new THREE.TubeGeometry(curve, SEGMENTS, SAME, 8);
    if (parts > 1) {
      const index = geometry.index.array, size = index.length / SEGMENTS, own = [];
      const width = Math.max(2, Math.floor(SEGMENTS / (ROUNDS * parts)));
      for (let s = 0; s < SEGMENTS; s++) if (Math.floor(s / width) % parts === part) own.push(...index.slice(s * size, (s + 1) * size));
      geometry.setIndex(own);
    }
    const path = new THREE.Mesh(geometry, new THREE.MeshBasicMaterial({ color: named(colour), side: THREE.DoubleSide }));
    const hidden = { color: named(colour), depthTest: false, transparent: true, opacity: 0.22 };
    path.add(new THREE.Mesh(geometry, new THREE.MeshBasicMaterial(hidden))); // faintly through what stands before it
    return path;
  }

  // Gives every run with a motion its `path`; `runs` have `tool`, points of the path, and `colour`.
  function addPaths(runs, layer) {
    const groups = []; // of runs that share one path
    for (const run of runs) {
      if (!run.tool) continue;
      const curve = smoothCurve(run.tool), spaced = curve && curve.getSpacedPoints(64);
      const same = spaced && groups.find((group) => group.spaced && group.spaced.every((p, i) => p.distanceTo(spaced[i]) < SAME));
      if (same) same.members.push({ run, curve }); else groups.push({ spaced, members: [{ run, curve }] });
    }
    for (const { members } of groups) {
      members.forEach(({ run, curve }, part) => {
        run.path = curve ? tube(curve, run.colour, part, members.length) : new THREE.Group();
        layer.add(run.path);
      });
    }
  }

  return { runColour, addPaths };
})();
