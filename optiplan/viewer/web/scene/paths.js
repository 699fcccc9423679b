"use strict";
// Tool paths: one run's by the speed of its tool, several runs' in a colour each, in stripes where paths coincide.
const OptiPlanPaths = (() => {
  const THREE = MeshCat.THREE, { named } = OptiPlanShapes;
  // No blue, green or red: those are the goal's, the start's and a contact's; collision shapes are a pale blue.
  const FIRST = ["#d1701f", "#7b3fa0", "#0e8a94", "#a8830b", "#c02f7c", "#59636b", "#8a5a2b", "#5c46c9", "#6b7a0f", "#e0559b"];
  const HUES = [[18, 70], [172, 190], [248, 335]]; // degrees that are left for the others
  const SAME = 4e-3; // m: the tube's radius; paths nearer than this look like one
  const SEGMENTS = 480, ROUNDS = 4, RING = 8; // of a tube, and how often each colour comes in a striped one
  const SPEEDS = ["#3b1c6e", "#7a2a8f", "#c43c77", "#f0704f", "#fbb43c", "#f6ef7f"]; // from standing to fastest

  function runColour(k) {
    if (k < FIRST.length) return FIRST[k];
    const whole = HUES.reduce((sum, [from, to]) => sum + to - from, 0);
    let at = ((0.618034 * k) % 1) * whole;
    for (const [from, to] of HUES) {
      if (at <= to - from) return "#" + new THREE.Color().setHSL((from + at) / 360, [0.75, 0.95, 0.5][k % 3], [0.42, 0.27, 0.62][k % 3]).getHexString();
      at -= to - from;
    }
    return FIRST[0];
  }

  function speedColour(share) {
    const x = Math.min(0.9999, Math.max(0, share)) * (SPEEDS.length - 1), k = Math.floor(x);
    return named(SPEEDS[k]).lerp(named(SPEEDS[k + 1]), x - k);
  }

  // The curve through the points, and the share of the time at which each part of its length is reached.
  function smoothCurve(points) {
    const line = [], times = [0], last = new THREE.Vector3(Infinity, 0, 0), before = new THREE.Vector3().fromArray(points, 0), p = new THREE.Vector3();
    for (let i = 0; i < points.length; i += 3) {
      p.fromArray(points, i);
      if (i) times.push(times[times.length - 1] + p.distanceTo(before));
      before.copy(p);
      if (p.distanceTo(last) > 2e-3) { line.push(p.clone()); last.copy(p); }
    }
    if (line.length < 2) return null;
    return Object.assign(new THREE.CatmullRomCurve3(line), { lengths: times });
  }

  // Speeds of the samples, m a sample.
  function speeds(points) {
    const count = points.length / 3, found = new Float32Array(count);
    for (let k = 0; k < count; k++) {
      const a = Math.max(0, k - 1), b = Math.min(count - 1, k + 1);
      found[k] = Math.hypot(...[0, 1, 2].map((i) => points[3 * b + i] - points[3 * a + i])) / Math.max(1, b - a);
    }
    return found;
  }

  const fastest = (tools) => Math.max(1e-12, ...tools.map((points) => speeds(points).reduce((a, b) => Math.max(a, b), 0)));

  function colourBySpeed(geometry, curve, points, most) {
    const share = speeds(points).map((v) => v / most), { lengths } = curve, total = lengths[lengths.length - 1], colours = [];
    let k = 0;
    for (let s = 0; s <= SEGMENTS; s++) {
      while (k < lengths.length - 1 && lengths[k + 1] < (s / SEGMENTS) * total) k++;
      const colour = speedColour(share[k]).toArray();
      for (let r = 0; r <= RING; r++) colours.push(...colour);
    }
    geometry.setAttribute("color", new THREE.Float32BufferAttribute(colours, 3));
  }

  // Member `part` of `parts` that share one path: every so many segments of the tube are its own.
  function tube(curve, colour, part, parts, points, most) {
    const geometry = new THREE.TubeGeometry(curve, SEGMENTS, SAME, RING);
    if (parts > 1) {
      const index = geometry.index.array, size = index.length / SEGMENTS, own = [];
      const width = Math.max(2, Math.floor(SEGMENTS / (ROUNDS * parts)));
      for (let s = 0; s < SEGMENTS; s++) if (Math.floor(s / width) % parts === part) own.push(...index.slice(s * size, (s + 1) * size));
      geometry.setIndex(own);
    }
    const look = points ? { vertexColors: true } : { color: named(colour) };
    if (points) colourBySpeed(geometry, curve, points, most);
    const path = new THREE.Mesh(geometry, new THREE.MeshBasicMaterial({ ...look, side: THREE.DoubleSide }));
    const hidden = { ...look, depthTest: false, transparent: true, opacity: 0.25 };
    path.add(new THREE.Mesh(geometry, new THREE.MeshBasicMaterial(hidden))); // faintly through what stands before it
    return path;
  }

  // Gives every run with a motion its `path`; `runs` have `tools`, points of the path of each tool, and `colour`.
  function addPaths(runs, layer, bySpeed) {
    const groups = []; // of runs that share one path
    for (const run of runs) {
      if (!run.tool) continue;
      run.path = new THREE.Group();
      layer.add(run.path);
      run.tools.forEach((points, tool) => {
        const curve = smoothCurve(points), spaced = curve && curve.getSpacedPoints(64);
        const same = spaced && groups.find((group) => group.tool === tool && group.spaced && group.spaced.every((p, i) => p.distanceTo(spaced[i]) < SAME));
        if (same) same.members.push({ run, curve }); else groups.push({ spaced, tool, members: [{ run, curve, points }] });
      });
    }
    for (const { members } of groups) {
      members.forEach(({ run, curve, points }, part) => {
        if (curve) run.path.add(tube(curve, run.colour, part, members.length, bySpeed ? points : null, bySpeed ? fastest(run.tools) : 0));
      });
    }
  }

  return { runColour, addPaths, SPEEDS };
})();
