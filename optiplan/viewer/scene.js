"use strict";
// Builds the three.js objects of a page's data inside a meshcat viewer. World frame: metres, z up.
const OptiPlanScene = (() => {
  const THREE = MeshCat.THREE, { floats, makeGeometry, rgb, named, place, palette } = OptiPlanShapes;
  const { runColour, addPaths } = OptiPlanPaths;
  const START = "#2f9e5b", GOAL = "#2374c6", RED = "#d3261f";

  class Scene {
    constructor(data, pane) {
      this.data = data;
      this.viewer = new MeshCat.Viewer(pane, false);
      this.viewer.set_3d_pane_size = () => this.resize(pane); // meshcat's own takes the whole window
      this.root = new THREE.Group();
      this.layers = {};
      for (const name of ["obstacle", "path", "start", "goal", "witness", "ellipsoids"]) {
        this.layers[name] = new THREE.Group();
        this.root.add(this.layers[name]);
      }
      this.geometries = data.geometries.map(makeGeometry);
      this.material = palette();
      this.addObstacles();
      this.coloured = 0;
      this.runs = data.runs.map((run, k) => this.addRun(run, k));
      if (!this.runs.length) this.runs.push(this.addRun({ duration: 0, witnesses: [] }, 0));
      addPaths(this.runs, this.layers.path);
      this.addGhost(this.layers.start, data.start, START);
      if (data.goal) this.addGhost(this.layers.goal, data.goal, GOAL);
      for (const pose of data.targets) this.addTarget(pose);
      this.addStage();
      this.addEllipsoids();
      this.resize(pane);
    }

    resize(pane) {
      const width = Math.max(1, pane.clientWidth), height = Math.max(1, pane.clientHeight), viewer = this.viewer;
      const card = document.getElementById("card"), aside = width > 760 && card.open ? 0.5 * card.offsetWidth : 0;
      viewer.camera.aspect = width / height;
      viewer.camera.setViewOffset(width, height, -aside, 0, width, height); // the middle of what the card leaves free
      viewer.camera.updateProjectionMatrix();
      viewer.renderer.setSize(width, height);
      viewer.set_dirty();
    }

    surface(colour, extra = {}) {
      const key = JSON.stringify([colour, extra]);
      return this.material(key, () => new THREE.MeshStandardMaterial(
        { color: rgb(colour), roughness: 0.62, metalness: 0.05, side: THREE.DoubleSide, ...extra }));
    }

    mesh(part, material) {
      const mesh = new THREE.Mesh(this.geometries[part.geometry], material);
      place(mesh, part.pose);
      mesh.name = part.name;
      mesh.castShadow = mesh.receiveShadow = true;
      return mesh;
    }

    addObstacles() {
      for (const part of this.data.parts.filter((p) => p.set === "obstacle")) {
        const plane = this.data.geometries[part.geometry].kind === "plane";
        const mesh = this.mesh(part, this.surface(part.colour, plane ? { transparent: true, opacity: 0.28, depthWrite: false } : {}));
        mesh.castShadow = !plane;
        mesh.userData.plane = plane && this.data.geometries[part.geometry];
        this.layers.obstacle.add(mesh);
      }
    }

    // One figure: a group a body, each with the parts of it; sets are switched on and off by name.
    figure(material, sets) {
      const figure = new THREE.Group();
      figure.bodies = Array.from({ length: this.data.bodies + 1 }, () => new THREE.Group());
      figure.add(...figure.bodies);
      for (const part of this.data.parts) {
        if (!sets.includes(part.set)) continue;
        for (const one of [].concat(material(part))) {
          const mesh = this.mesh(part, one);
          mesh.userData.set = part.set;
          mesh.visible = part.set !== "collision";
          mesh.renderOrder = one.userData.order || 0;
          mesh.castShadow = !one.transparent && one.colorWrite;
          figure.bodies[part.body].add(mesh);
        }
      }
      this.root.add(figure);
      return figure;
    }

    pose(figure, poses, sample = 0) {
      for (let j = 0; j < this.data.bodies; j++) place(figure.bodies[j + 1], poses, 7 * (sample * this.data.bodies + j));
    }

    addRun(run, k) {
      const colour = runColour(this.coloured), tint = this.coloured === 0 ? 0 : 0.55;
      if (run.path) this.coloured++; // what did not move needs no colour of its own
      const mixed = new THREE.Color(colour).toArray(), behind = { polygonOffset: true, polygonOffsetFactor: 0.5 * k, polygonOffsetUnits: k };
      const material = (part) => this.surface(part.colour.map((c, i) => (i < 3 ? c + tint * (mixed[i] - c) : c)), k ? behind : {});
      const figure = this.figure(material, ["visual", "collision", "frame", "attached"]);
      figure.bodies[0].visible = k === 0; // what is bolted down is the same in every figure
      const poses = run.poses ? floats(run.poses) : floats(this.data.start);
      const shown = { figure, poses, samples: run.samples || 1, duration: run.duration || 0, colour, path: null, witness: new THREE.Group() };
      this.layers.witness.add(shown.witness);
      this.pose(figure, poses);
      if (run.path) shown.tool = floats(run.path);
      for (const witness of run.witnesses) this.addWitness(witness, shown.witness);
      return shown;
    }

    addEllipsoids() {
      const size = 0.075 * this.box.getSize(new THREE.Vector3()).length();
      this.runs.forEach((run, k) => {
        const packed = k < this.data.runs.length && this.data.runs[k].ellipsoids;
        if (!packed) return;
        run.ellipsoids = new OptiPlanEllipsoids.Ellipsoids(floats(packed), run.tool, size);
        this.layers.ellipsoids.add(run.ellipsoids.group);
      });
    }

    // Depth first, colour second: a ghost shows its outer skin only, not the parts inside.
    ghostMaterials(colour, opacity) {
      const depth = this.material("depth" + colour, () => new THREE.MeshBasicMaterial(
        { colorWrite: false, polygonOffset: true, polygonOffsetFactor: 2, polygonOffsetUnits: 4 }));
      const skin = this.material("skin" + colour, () => new THREE.MeshStandardMaterial(
        { color: named(colour), transparent: true, opacity, roughness: 0.8, depthWrite: false,
          polygonOffset: true, polygonOffsetFactor: 2, polygonOffsetUnits: 4 }));
      depth.userData.order = 1;
      skin.userData.order = 2;
      return [depth, skin];
    }

    addGhost(layer, poses, colour, opacity = 0.3) {
      const materials = this.ghostMaterials(colour, opacity);
      const ghost = this.figure(() => materials, ["visual", "frame", "attached"]);
      ghost.bodies[0].visible = false;
      for (const body of ghost.bodies) body.traverse((o) => { o.receiveShadow = false; });
      this.pose(ghost, floats(poses));
      layer.add(ghost);
    }

    addTarget(pose) {
      const axes = new THREE.AxesHelper(0.12);
      place(axes, pose);
      this.layers.goal.add(axes);
    }

    addWitness(witness, layer) {
      if (witness.poses) this.addGhost(layer, witness.poses, RED, 0.45);
      const material = this.material("red", () => new THREE.MeshBasicMaterial({ color: named(RED), depthTest: false, transparent: true }));
      for (const point of witness.points) {
        const ball = new THREE.Mesh(new THREE.SphereGeometry(0.012, 20, 12), material);
        ball.position.fromArray(point);
        ball.renderOrder = 5;
        layer.add(ball);
      }
      if (witness.points.length === 2) {
        const ends = witness.points.map((p) => new THREE.Vector3(...p));
        if (ends[0].distanceTo(ends[1]) > 1e-3) {
          const rod = new THREE.TubeGeometry(new THREE.LineCurve3(...ends), 1, 0.004, 8);
          const line = new THREE.Mesh(rod, material);
          line.renderOrder = 5;
          layer.add(line);
        }
      }
    }

    // What the camera must show: the robot all along, and obstacles that are not far larger than it.
    bounds() {
      const box = new THREE.Box3(), robot = new THREE.Box3(), one = new THREE.Box3();
      this.root.updateMatrixWorld(true);
      for (const run of this.runs) {
        for (let k = 0; k <= 8; k++) {
          this.pose(run.figure, run.poses, Math.round((k / 8) * (run.samples - 1)));
          run.figure.updateMatrixWorld(true);
          robot.expandByObject(run.figure);
        }
        this.pose(run.figure, run.poses);
      }
      const size = robot.getSize(new THREE.Vector3()).length(), middle = robot.getCenter(new THREE.Vector3());
      box.copy(robot);
      for (const mesh of this.layers.obstacle.children) {
        one.setFromObject(mesh);
        if (!mesh.userData.plane && one.getCenter(new THREE.Vector3()).distanceTo(middle) < 1.5 * size && one.getSize(new THREE.Vector3()).length() < 2.5 * size) box.union(one);
      }
      return box;
    }

    addStage() {
      const { scene, renderer } = this.viewer;
      for (const path of ["/Lights", "/Grid", "/Axes"]) this.viewer.handle_command({ type: "delete", path });
      this.viewer.handle_command({ type: "set_property", path: "/Background", property: "visible", value: false });
      scene.add(this.root);
      scene.background = new THREE.Color("#eef1f3"); // three.js 132 clears without converting colours
      renderer.outputEncoding = THREE.sRGBEncoding;
      scene.updateMatrixWorld(true);
      this.box = this.bounds();
      const centre = this.box.getCenter(new THREE.Vector3()), radius = 0.5 * this.box.getSize(new THREE.Vector3()).length();
      for (const mesh of this.layers.obstacle.children) if (mesh.userData.plane) this.spreadPlane(mesh, scene.worldToLocal(centre.clone()), 1.2 * radius);
      this.addLights(scene, centre, radius);
      this.addFloor(scene, centre, radius);
    }

    // A half-space has no end: what is drawn is the piece of its surface nearest to the scene.
    spreadPlane(mesh, centre, size) {
      const { normal, offset } = mesh.userData.plane, n = new THREE.Vector3(...normal).normalize();
      const foot = n.clone().multiplyScalar(offset).applyQuaternion(mesh.quaternion).add(mesh.position);
      n.applyQuaternion(mesh.quaternion);
      mesh.position.copy(centre).addScaledVector(n, n.dot(foot.sub(centre)));
      mesh.quaternion.setFromUnitVectors(new THREE.Vector3(0, 0, 1), n);
      mesh.scale.set(size, size, 1);
      mesh.add(new THREE.LineSegments(new THREE.EdgesGeometry(mesh.geometry), new THREE.LineBasicMaterial({ color: named("#a79a88") })));
    }

    addLights(scene, centre, radius) {
      const sun = new THREE.DirectionalLight(0xffffff, 0.62);
      const up = scene.worldToLocal(centre.clone());
      sun.position.copy(up).add(new THREE.Vector3(1.2, -1.6, 3).multiplyScalar(radius));
      sun.target.position.copy(up);
      sun.castShadow = true;
      sun.shadow.mapSize.set(2048, 2048);
      Object.assign(sun.shadow.camera, { left: -1.4 * radius, right: 1.4 * radius, top: 1.4 * radius, bottom: -1.4 * radius, near: 0.01, far: 8 * radius });
      sun.shadow.bias = -5e-4;
      sun.shadow.normalBias = 4e-3 * radius;
      sun.shadow.radius = 3;
      const sky = new THREE.HemisphereLight(0xffffff, 0xd8d2ca, 0.6);
      sky.position.set(0, 0, 1);
      const side = new THREE.DirectionalLight(0xdfe9ff, 0.18);
      side.position.set(-2, 1, 1.2);
      scene.add(sun, sun.target, sky, side);
    }

    addFloor(scene, centre, radius) {
      const low = this.box.min.y - 0.002, cell = radius > 2.5 ? 0.5 : 0.25, half = cell * Math.ceil((2.6 * radius) / cell);
      const middle = scene.worldToLocal(centre.clone());
      const x = cell * Math.round(middle.x / cell), y = cell * Math.round(middle.y / cell);
      const shade = new THREE.Mesh(new THREE.PlaneGeometry(8 * half, 8 * half), new THREE.ShadowMaterial({ opacity: 0.14, depthWrite: false }));
      shade.receiveShadow = true;
      shade.position.set(x, y, low - 1e-3);
      const grid = new THREE.GridHelper(2 * half, Math.round((2 * half) / cell), named("#b9c2c8"), named("#d3dade"));
      grid.rotateX(Math.PI / 2);
      grid.position.set(x, y, low);
      this.floor = new THREE.Group();
      this.floor.add(shade, grid);
      scene.add(this.floor);
    }

    // The first view: of some directions around, the one from which obstacles hide least of the motion.
    bestDirection(centre, distance) {
      const moving = this.runs.filter((run) => run.tool), targets = [], rays = new THREE.Raycaster(), solid = this.layers.obstacle.children.filter((m) => !m.userData.plane);
      const aim = (array, offset) => targets.push(this.root.localToWorld(new THREE.Vector3().fromArray(array, offset)));
      for (const run of (moving.length ? moving : this.runs).slice(0, 2)) {
        for (let k = 0; k < 9; k++) {
          const s = Math.round((k / 8) * (run.samples - 1));
          if (run.tool) aim(run.tool, 3 * s);
          if (k % 2 === 0) for (let j = this.data.bodies; j > 0; j -= 3) aim(run.poses, 7 * (s * this.data.bodies + j - 1));
        }
      }
      let best = null, least = Infinity;
      for (const [azimuth, elevation] of [[-40, 24], [40, 24], [-75, 24], [75, 24], [-40, 45], [40, 45], [-110, 26], [110, 26], [-130, 26], [130, 26], [-150, 32], [150, 32]]) {
        const a = (azimuth * Math.PI) / 180, e = (elevation * Math.PI) / 180;
        const toward = new THREE.Vector3(Math.cos(a) * Math.cos(e), Math.sin(e), -Math.sin(a) * Math.cos(e));
        const eye = centre.clone().addScaledVector(toward, distance);
        let hidden = 0;
        for (const target of targets) {
          const ray = target.clone().sub(eye);
          rays.far = ray.length();
          rays.set(eye, ray.normalize());
          if (rays.intersectObjects(solid, false).length) hidden++;
        }
        if (hidden < least - 0.5) { least = hidden; best = toward; }
      }
      return best;
    }

    frame() {
      const { camera, controls } = this.viewer, centre = this.box.getCenter(new THREE.Vector3());
      camera.fov = 32;
      const radius = 0.5 * this.box.getSize(new THREE.Vector3()).length();
      const half = Math.atan(Math.tan((camera.fov * Math.PI) / 360) * Math.min(1, camera.aspect));
      const distance = (0.86 * radius) / Math.sin(half);
      this.direction = this.direction || this.bestDirection(centre, distance);
      camera.near = 0.02 * radius;
      camera.far = 60 * radius;
      camera.position.copy(centre).addScaledVector(this.direction, distance);
      controls.target.copy(centre);
      controls.update();
      this.viewer.set_dirty();
    }
  }
  return { Scene };
})();
