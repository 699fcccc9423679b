"use strict";
// The pointer in the live scene: it drags the goal's frame, obstacles and their knobs, and chooses obstacles and ghosts.
const SceneHand = (() => {
  const THREE = MeshCat.THREE, CLICK = 4; // px: less than that is no drag
  const poseOf = (object) => [...object.position.toArray(), ...object.quaternion.toArray()];

  // An obstacle moves level, with shift up and down.
  function carry(scene, object, rays, upright) {
    const at = object.getWorldPosition(new THREE.Vector3()), up = new THREE.Vector3(0, 1, 0), hit = new THREE.Vector3();
    const sight = scene.viewer.camera.getWorldDirection(new THREE.Vector3()).setY(0).normalize();
    const plane = new THREE.Plane().setFromNormalAndCoplanarPoint(upright ? sight : up, at), begin = rays.ray.intersectPlane(plane, new THREE.Vector3());
    return begin && ((now) => {
      if (!now.ray.intersectPlane(plane, hit)) return false;
      object.position.copy(scene.root.worldToLocal(at.clone().add(hit).sub(begin)));
      return true;
    });
  }

  // A knob pulls its end of the shape; the other end stays.
  function stretch(scene, knob, rays) {
    const pull = Gizmo.pull(knob, rays, scene.viewer.camera), { end } = knob.userData;
    const mesh = scene.obstacles.children.find((one) => one.name === scene.chosen), began = mesh.position.clone();
    if (!pull) return null;
    return (now) => {
      const by = pull(now);
      if (by === null) return false;
      const shape = end.pulled(by), [kind] = Object.keys(shape), of = shape[kind];
      if (end.moves) mesh.position.copy(began).addScaledVector(new THREE.Vector3(...end.axis).applyQuaternion(mesh.quaternion), 0.5 * by);
      if (!scene.geometries.includes(mesh.geometry)) mesh.geometry.dispose();
      mesh.geometry = OptiPlanShapes.makeGeometry(kind === "box" ? { kind, size: of } : kind === "sphere" ? { kind, radius: of } : { kind, ...of });
      scene.stretched = shape;
      return true;
    };
  }

  // What a press takes hold of: {object, move, kind}; null for nothing.
  function grip(scene, rays, event) {
    const { camera } = scene.viewer, mesh = scene.obstacles.children.find((one) => one.name === scene.chosen);
    const knob = mesh && scene.knobs && rays.intersectObjects(scene.knobs.children)[0], part = scene.grip(rays);
    if (knob) return { kind: "size", object: mesh, move: stretch(scene, knob.object, rays) };
    if (part) return { kind: "goal", object: scene.handle, move: GoalFrame.drag(scene.handle, part, rays, camera) };
    if (mesh && scene.knobs) {
      const own = GoalFrame.met(scene.frameOf, rays);
      if (own && own.kind !== "ball") return { kind: "obstacle", object: mesh, move: framed(scene, mesh, own, rays) };
    }
    const found = scene.events.obstacle && met(scene, rays);
    return found && !found.object.userData.fixed ? { kind: "obstacle", object: found.object, move: carry(scene, found.object, rays, event.shiftKey) } : null;
  }

  // The obstacle's own frame: what turns the gizmo turns the obstacle.
  function framed(scene, mesh, part, rays) {
    const turn = GoalFrame.drag(mesh, part, rays, scene.viewer.camera);
    return turn && ((now) => turn(now) && Boolean(scene.gizmo.position.copy(mesh.position) && scene.gizmo.quaternion.copy(mesh.quaternion)));
  }

  // The first obstacle that a ray meets, unless the robot is before it.
  function met(scene, rays) {
    const found = rays.intersectObjects([...scene.obstacles.children, scene.robot], true)[0];
    return found && scene.obstacles.children.includes(found.object) ? found : null;
  }

  function clicked(scene, rays) {
    if (scene.pointing) {
      const found = met(scene, rays);
      if (!found || !scene.events.surface) return;
      const normal = found.face.normal.clone().applyQuaternion(found.object.quaternion);
      scene.events.surface(scene.root.worldToLocal(found.point.clone()).toArray(), normal.toArray());
      return;
    }
    const ball = rays.intersectObjects(scene.others.children)[0];
    if (ball) { scene.events.goal(null, false, ball.object.userData.index); return; }
    const ghost = scene.events.branch && rays.intersectObjects(scene.ghosts.children, true)[0], found = met(scene, rays);
    if (ghost && (!found || ghost.distance < found.distance)) {
      scene.events.branch(scene.ghosts.children.find((one) => one.bodies.includes(ghost.object.parent)).index);
      return;
    }
    if (scene.events.selected) scene.events.selected(found ? found.object.name : null);
  }

  function listen(scene) {
    const rays = new THREE.Raycaster(), { pane } = scene;
    let pressed = null;
    scene.held = null;
    const aim = (event) => {
      const area = pane.getBoundingClientRect();
      rays.setFromCamera(new THREE.Vector2((2 * (event.clientX - area.left)) / area.width - 1, 1 - (2 * (event.clientY - area.top)) / area.height), scene.viewer.camera);
    };
    pane.addEventListener("pointerdown", (event) => {
      if (!scene.data || event.button !== 0) return;
      aim(event);
      pressed = [event.clientX, event.clientY];
      const found = scene.pointing ? null : grip(scene, rays, event);
      if (!found || !found.move) return;
      scene.held = { ...found, moved: false };
      scene.viewer.controls.enabled = false;
      pane.setPointerCapture(event.pointerId);
      event.stopPropagation();
    }, true);
    pane.addEventListener("pointermove", (event) => {
      if (!scene.data) return;
      aim(event);
      if (!scene.held) {
        if (event.pointerType === "mouse" && !event.buttons) pane.style.cursor = scene.pointing ? "crosshair" : grip(scene, rays, event) ? "grab" : "";
        return;
      }
      if (pressed && Math.hypot(event.clientX - pressed[0], event.clientY - pressed[1]) < CLICK && !scene.held.moved) return;
      const { kind, object } = scene.held;
      if (!scene.held.move(rays)) return;
      scene.held.moved = true;
      if (kind === "goal") scene.events.goal(scene.goal(), false);
      else if (kind === "size") scene.events.resized(object.name, scene.stretched, poseOf(object), false);
      else if (scene.events.moving) scene.events.moving(object.name, poseOf(object));
      if (kind !== "goal" && object.name === scene.chosen) {
        scene.gizmo.position.copy(object.position);
        if (kind === "size") scene.knobs.visible = false;
      }
      scene.viewer.set_dirty();
    });
    const drop = (event) => {
      const { held } = scene, still = pressed && Math.hypot(event.clientX - pressed[0], event.clientY - pressed[1]) < CLICK;
      pressed = scene.held = null;
      scene.viewer.controls.enabled = true;
      if (event.type === "pointerup" && still && !(held && held.moved) && scene.data) {
        aim(event);
        clicked(scene, rays);
      }
      if (held && held.moved) {
        if (held.kind === "goal") scene.events.goal(scene.goal(), true);
        else if (held.kind === "size") scene.events.resized(held.object.name, scene.stretched, poseOf(held.object), true);
        else scene.events.obstacle(held.object.name, poseOf(held.object));
      }
      if (held) pane.dispatchEvent(new Event("optiplan:dropped"));
    };
    pane.addEventListener("pointerup", drop);
    pane.addEventListener("pointercancel", drop);
  }
  return { listen, poseOf };
})();
