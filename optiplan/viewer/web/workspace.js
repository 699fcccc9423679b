"use strict";
// Reached voxels of robots that stand side by side, true to scale. World frame: metres, z up, x to the right.
const OptiPlanWorkspace = (() => {
  const THREE = MeshCat.THREE, { floats } = OptiPlanPacked, { makeGeometry, rgb, named, place, palette, triad, undrawn } = OptiPlanShapes;
  const { Labels } = OptiPlanBodies;
  const MISSED = "#d6403a", FILL = 0.82, SMALL = 0.34;
  const LAYERS = { robot: "robots", reached: "reached", missed: "not reached", axes: "axes", sphere: "reach sphere" };
  const VIRIDIS = [[68, 1, 84], [71, 44, 122], [59, 81, 139], [44, 113, 142], [33, 144, 141], [39, 173, 129], [92, 200, 99], [170, 220, 50], [253, 231, 37]];
  const $ = (id) => document.getElementById(id);

  function colour(t) {
    const x = Math.min(Math.max(t, 0), 1) * (VIRIDIS.length - 1), k = Math.min(Math.floor(x), VIRIDIS.length - 2), f = x - k;
    return VIRIDIS[k].map((c, i) => (c * (1 - f) + VIRIDIS[k + 1][i] * f) / 255);
  }

  class Workspace {
    constructor(data, pane) {
      Object.assign(this, { data, pane });
      this.viewer = new MeshCat.Viewer(pane, false);
      this.viewer.set_3d_pane_size = () => this.resize();
      this.root = new THREE.Group();
      this.layers = Object.fromEntries(Object.keys(LAYERS).map((name) => [name, new THREE.Group()]));
      this.root.add(...Object.values(this.layers));
      this.labels = new Labels($("labels"));
      this.material = palette();
      this.robots = data.robots.map((robot) => this.addRobot(robot));
      this.prepare();
      this.ring = this.marker();
      this.resize();
    }

    addRobot(robot) {
      const shown = { data: robot, points: floats(robot.points), counts: floats(robot.counts), values: {}, rows: floats(robot.rows), q: floats(robot.q) };
      for (const name in robot.values) shown.values[name] = floats(robot.values[name]);
      shown.top = Object.fromEntries(Object.entries(shown.values).map(([name, value]) => [name, value.reduce((high, v) => Math.max(high, v), 0) || 1]));
      shown.figure = this.figure(robot);
      shown.figure.position.x = robot.offset;
      this.layers.robot.add(shown.figure);
      this.pose(shown, robot.usual);
      const box = new THREE.BoxGeometry(1, 1, 1), count = shown.points.length / 3;
      const reached = new THREE.MeshStandardMaterial({ roughness: 0.8 }), missed = new THREE.MeshBasicMaterial({ color: named(MISSED), transparent: true, opacity: 0.5 });
      shown.reached = new THREE.InstancedMesh(box, reached, count);
      shown.missed = new THREE.InstancedMesh(box, missed, count);
      for (const mesh of [shown.reached, shown.missed]) { mesh.frustumCulled = false; mesh.position.x = robot.offset; }
      this.layers.reached.add(shown.reached);
      this.layers.missed.add(shown.missed);
      const sphere = new THREE.Mesh(new THREE.SphereGeometry(robot.radius, 64, 32), new THREE.MeshBasicMaterial({ color: named("#7a8794"), wireframe: true, transparent: true, opacity: 0.07 }));
      sphere.position.set(robot.shoulder[0] + robot.offset, robot.shoulder[1], robot.shoulder[2]);
      this.layers.sphere.add(sphere);
      this.addAxes(robot);
      return shown;
    }

    figure(robot) {
      const geometries = robot.geometries.map(makeGeometry), figure = new THREE.Group();
      figure.bodies = Array.from({ length: robot.tree.parents.length + 1 }, () => new THREE.Group());
      figure.add(...figure.bodies);
      for (const part of robot.parts) {
        if (part.set === "collision") continue;
        const look = this.material(part.colour.join(), () => new THREE.MeshStandardMaterial({ color: rgb(part.colour), roughness: 0.62, metalness: 0.05, side: THREE.DoubleSide }));
        const mesh = new THREE.Mesh(geometries[part.geometry], look);
        place(mesh, part.pose);
        mesh.castShadow = mesh.receiveShadow = true;
        figure.bodies[part.body].add(mesh);
      }
      return figure;
    }

    // Lets a robot stand at the positions `q` of its planned joints: X_WJ = X_WP X_PJ exp([S] p_j), p = A q + b.
    pose({ figure, data: { tree } }, q) {
      const slide = new THREE.Vector3(), axis = new THREE.Vector3(), turn = new THREE.Quaternion();
      tree.parents.forEach((parent, j) => {
        const body = figure.bodies[j + 1], above = figure.bodies[parent];
        const p = tree.coupling[j].reduce((sum, factor, i) => sum + factor * q[i], tree.offset[j]);
        place(body, tree.placements[j]);
        body.position.add(slide.fromArray(tree.screws[j]).multiplyScalar(p).applyQuaternion(body.quaternion));
        body.quaternion.multiply(turn.setFromAxisAngle(axis.fromArray(tree.screws[j], 3), p));
        body.position.applyQuaternion(above.quaternion).add(above.position);
        body.quaternion.premultiply(above.quaternion);
      });
    }

    // Axes of the robot's world through its origin, with figures along them, m.
    addAxes(robot) {
      const group = new THREE.Group(), { radius, offset, shoulder } = robot, step = radius > 1.6 ? 0.5 : radius > 0.8 ? 0.25 : 0.1;
      group.position.x = offset;
      group.add(triad(0.22 * radius));
      group.ticks = [];
      ["x", "y", "z"].forEach((name, i) => {
        const low = Math.ceil((shoulder[i] - radius) / step), high = Math.floor((shoulder[i] + radius) / step), at = (v) => [0, 1, 2].map((j) => (i === j ? v : 0));
        const line = new THREE.BufferGeometry().setFromPoints([new THREE.Vector3(...at(low * step)), new THREE.Vector3(...at(high * step))]);
        group.add(new THREE.Line(line, new THREE.LineBasicMaterial({ color: named(["#d3261f", "#2f9e5b", "#2374c6"][i]) })));
        const every = Math.max(1, Math.ceil((high - low) / 2));
        for (let k = low; k <= high; k++) if (k !== 0 && (k % every === 0 || k === high)) group.ticks.push([`${name} ${(k * step).toFixed(step < 0.25 ? 1 : 2)}`, at(k * step)]);
      });
      this.layers.axes.add(group);
      group.ticks = group.ticks.map(([text, point]) => [this.labels.add(text), point, offset]);
      (this.ticks = this.ticks || []).push(...group.ticks);
      const label = this.labels.add(robot.name, "name");
      (this.names = this.names || []).push([label, [shoulder[0] + offset, shoulder[1], shoulder[2] + radius], 18]);
    }

    marker() {
      const ring = new THREE.LineSegments(new THREE.EdgesGeometry(new THREE.BoxGeometry(1, 1, 1)), new THREE.LineBasicMaterial({ color: named("#b8126f"), depthTest: false }));
      ring.visible = false;
      ring.renderOrder = 5;
      this.root.add(ring);
      return ring;
    }

    prepare() {
      const { scene, renderer, controls, camera } = this.viewer;
      for (const path of ["/Lights", "/Grid", "/Axes"]) this.viewer.handle_command({ type: "delete", path });
      this.viewer.handle_command({ type: "set_property", path: "/Background", property: "visible", value: false });
      scene.add(this.root);
      renderer.outputEncoding = THREE.sRGBEncoding;
      scene.updateMatrixWorld(true);
      const box = new THREE.Box3().setFromObject(this.layers.sphere), low = new THREE.Box3().setFromObject(this.layers.robot).min.y;
      this.box = box;
      this.stage = new OptiPlanStage.Stage(this.viewer, this.root, box, Math.min(low, 0));
      Object.assign(camera, { fov: 32, near: 0.02 * this.stage.radius, far: 60 * this.stage.radius });
      controls.enableDamping = false;
      for (const [label, point, offset] of this.ticks) label.point.copy(this.root.localToWorld(new THREE.Vector3(point[0] + offset, point[1], point[2])));
      for (const [label, point, lift] of this.names) { label.point.copy(this.root.localToWorld(new THREE.Vector3(...point))); label.lift = lift; }
    }

    resize() {
      const width = Math.max(1, this.pane.clientWidth), height = Math.max(1, this.pane.clientHeight), { camera, renderer } = this.viewer;
      Object.assign(this, { width, height });
      camera.aspect = width / height;
      camera.updateProjectionMatrix();
      renderer.setSize(width, height);
      this.viewer.set_dirty();
    }

    frame() {
      const direction = new THREE.Vector3(0.45, 0.42, 0.79).normalize(), centre = this.box.getCenter(new THREE.Vector3());
      OptiPlanCamera.look(this.viewer, centre, direction, OptiPlanCamera.distance(this.viewer.camera, this.box, direction));
      this.viewer.controls.maxPolarAngle = Math.PI; // the lower half is seen from below
    }

    // Colours and the cut: `axis` x, y, z or none, `share` of the reach.
    paint(name, axis, share) {
      const top = Math.max(...this.robots.map((robot) => robot.top[name])), i = "xyz".indexOf(axis), sign = axis === "z" ? -1 : 1;
      const matrix = new THREE.Matrix4(), paint = new THREE.Color();
      for (const robot of this.robots) {
        const { points, values, data, reached, missed } = robot, value = values[name];
        robot.shown = [];
        robot.gaps = [];
        for (let k = 0; k < value.length; k++) {
          if (axis && sign * (points[3 * k + i] - data.shoulder[i]) < sign * share * data.radius - 1e-6) continue;
          (value[k] < 0 ? robot.gaps : robot.shown).push(k);
        }
        for (const [mesh, list, size] of [[reached, robot.shown, FILL * data.edge], [missed, robot.gaps, SMALL * data.edge]]) {
          list.forEach((k, row) => {
            matrix.makeScale(size, size, size).setPosition(points[3 * k], points[3 * k + 1], points[3 * k + 2]);
            mesh.setMatrixAt(row, matrix);
            if (mesh === reached) mesh.setColorAt(row, paint.setRGB(...colour(value[k] / top)).convertSRGBToLinear());
          });
          mesh.count = list.length;
          mesh.instanceMatrix.needsUpdate = true;
          if (mesh.instanceColor) mesh.instanceColor.needsUpdate = true;
        }
      }
      this.viewer.set_dirty();
      return top;
    }

    // Lets the robots be seen among the voxels.
    seeThrough(on) {
      for (const { reached } of this.robots) Object.assign(reached.material, { transparent: on, opacity: on ? 0.16 : 1, depthWrite: !on, needsUpdate: true });
      this.viewer.set_dirty();
    }

    // The voxel under a place of the picture: [robot, its number], or null.
    voxelAt(x, y) {
      const rays = new THREE.Raycaster(), meshes = [];
      for (const name of ["reached", "missed"]) if (this.layers[name].visible) meshes.push(...this.layers[name].children.filter((mesh) => mesh.count));
      rays.setFromCamera({ x: (2 * x) / this.width - 1, y: 1 - (2 * y) / this.height }, this.viewer.camera);
      const hit = rays.intersectObjects(meshes, false)[0];
      if (!hit) return null;
      const robot = this.robots.find((one) => one.reached === hit.object || one.missed === hit.object);
      return [robot, (hit.object === robot.reached ? robot.shown : robot.gaps)[hit.instanceId]];
    }

    // Marks a voxel, and lets the robot stand as in its best sample there; null: nothing.
    point(found) {
      this.ring.visible = Boolean(found);
      for (const robot of this.robots) {
        const row = found && found[0] === robot ? robot.rows[found[1]] : -1, n = robot.data.joints.length;
        this.pose(robot, row < 0 ? robot.data.usual : robot.q.subarray(row * n, (row + 1) * n));
      }
      if (found) {
        const [robot, k] = found;
        this.ring.position.set(robot.points[3 * k] + robot.data.offset, robot.points[3 * k + 1], robot.points[3 * k + 2]);
        this.ring.scale.setScalar(robot.data.edge);
      }
      this.viewer.renderer.shadowMap.needsUpdate = true;
      this.viewer.set_dirty();
    }

    draw() {
      if (!this.viewer.needs_render) return;
      this.viewer.render();
      for (const [label] of this.ticks) label.visible = this.layers.axes.visible;
      this.labels.place(this.viewer.camera, this.width, this.height);
    }
  }

  function readout(page, found) {
    if (!found) { $("readout").textContent = "Point at a voxel for its numbers; the robot then stands as in the most dexterous sample there."; return; }
    const [robot, k] = found, rows = [["centre x, y, z, m", [0, 1, 2].map((i) => robot.points[3 * k + i].toFixed(3)).join(", ")], ["samples", String(robot.counts[k])]];
    for (const name in robot.values) rows.push([page.data.labels[name], robot.values[name][k] < 0 ? "not reached" : robot.values[name][k].toPrecision(4)]);
    const row = robot.rows[k];
    if (row >= 0) robot.data.joints.forEach((joint, j) => rows.push([joint, robot.q[row * robot.data.joints.length + j].toFixed(3)]));
    const name = document.createElement("b"), list = document.createElement("dl");
    name.textContent = `${robot.data.name}, ${robot.data.tool}`;
    for (const [what, value] of rows) {
      const dt = document.createElement("dt"), dd = document.createElement("dd");
      dt.textContent = what;
      dd.textContent = value;
      list.append(dt, dd);
    }
    $("readout").replaceChildren(name, list);
  }

  function start() {
    const data = JSON.parse($("data").textContent), page = new Workspace(data, $("pane"));
    for (const name of Object.keys(data.robots[0].values)) $("value").add(new Option(data.labels[name], name));
    for (const robot of data.robots) {
      const line = document.createElement("p");
      line.textContent = robot.caption;
      $("captions").append(line);
    }
    const tick = (name, words, checked, change) => {
      const label = document.createElement("label"), box = Object.assign(document.createElement("input"), { type: "checkbox", checked });
      box.addEventListener("change", () => change(box.checked));
      label.append(box, ` ${words}`);
      label.dataset.layer = name;
      $("layers").append(label);
    };
    for (const name in LAYERS) {
      const show = (on) => { page.layers[name].visible = on; page.viewer.renderer.shadowMap.needsUpdate = true; page.viewer.set_dirty(); };
      show(name !== "missed");
      tick(name, LAYERS[name], name !== "missed", show);
    }
    tick("through", "see-through", false, (on) => page.seeThrough(on));
    const repaint = () => {
      $("cut").disabled = !$("axis").value;
      $("high").textContent = page.paint($("value").value, $("axis").value, Number($("cut").value)).toPrecision(3);
    };
    for (const id of ["value", "axis", "cut"]) $(id).addEventListener("input", repaint);
    const pen = $("scale").querySelector("canvas").getContext("2d");
    for (let k = 0; k < 256; k++) { pen.fillStyle = `rgb(${colour(k / 255).map((c) => Math.round(255 * c))})`; pen.fillRect(k, 0, 1, 12); }
    const pane = $("pane");
    let pressed = false;
    pane.addEventListener("pointerdown", () => { pressed = true; });
    addEventListener("pointerup", () => { pressed = false; });
    const look = (event) => {
      const at = pane.getBoundingClientRect();
      page.select(page.voxelAt(event.clientX - at.left, event.clientY - at.top));
    };
    page.select = (found) => { page.found = found; page.point(found); readout(page, found); };
    pane.addEventListener("pointermove", (event) => { if (!pressed && event.pointerType !== "touch") look(event); });
    pane.addEventListener("click", look);
    $("home").addEventListener("click", () => page.frame());
    addEventListener("keydown", (event) => { if (event.key === "0" && !/^(INPUT|SELECT)$/.test(event.target.tagName)) page.frame(); });
    $("theme").addEventListener("click", () => {
      const root = document.documentElement;
      root.dataset.theme = getComputedStyle(root).colorScheme === "dark" ? "light" : "dark";
      page.stage.colour();
      page.viewer.set_dirty();
    });
    new ResizeObserver(() => page.resize()).observe(pane);
    repaint();
    page.point(null);
    readout(page, null);
    page.frame();
    const turn = () => { page.draw(); requestAnimationFrame(turn); };
    turn();
    document.documentElement.dataset.ready = "1";
    return page;
  }

  try { return start(); } catch (error) {
    $("trouble").textContent = undrawn(error, "the numbers are here");
    $("trouble").hidden = false;
    const data = JSON.parse($("data").textContent);
    if (!$("captions").children.length) for (const robot of data.robots) $("captions").append(Object.assign(document.createElement("p"), { textContent: robot.caption }));
    document.documentElement.dataset.ready = "1";
    return null;
  }
})();
