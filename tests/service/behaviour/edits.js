// Edits of texts and of the studio, made by the hundred for its tests.
const everyEdit = (text) => {
  const { set, add, remove, applied } = ProblemText, read = (text) => CM.parseDocument(text).toJS(), wrong = [];
  const near = (key, value) => typeof value === "number" ? Number(value.toPrecision(7)) : value;
  const same = (a, b) => JSON.stringify(a, near) === JSON.stringify(b, near);
  const comments = (text) => (text.match(/#.*/g) || []).length, whole = read(text);
  const some = (keys, list) => (list && keys.length > 4 ? [0, 1, keys.length - 1].map((k) => keys[k]) : keys); // of a long list, both ends
  let count = 0;
  function changed(path, act) {
    const copy = structuredClone(whole);
    act(path.slice(0, -1).reduce((one, key) => one[key], copy), path.at(-1));
    return copy;
  }
  function expect(what, path, edits, wish) {
    count++;
    const after = applied(text, edits);
    if (!same(read(after), wish)) wrong.push([what, path, after]);
    return after;
  }
  function visit(value, path) {
    if (path.length) {
      const inner = value && typeof value === "object" && !Array.isArray(value) && Object.keys(value).length ? value : {};
      if (typeof value === "number") {
        const after = expect("number", path, set(text, path, value + 0.125), changed(path, (of, key) => { of[key] = value + 0.125; }));
        if (comments(after) !== comments(text) || after.split("\n").length !== text.split("\n").length) wrong.push(["comments", path]);
      }
      expect("list", path, set(text, path, [1, 2, 3]), changed(path, (of, key) => { of[key] = [1, 2, 3]; }));
      expect("map", path, set(text, path, { a: 1 }), changed(path, (of, key) => { of[key] = { ...inner, a: 1 }; }));
      if (Array.isArray(value)) expect("entry", path, add(text, path, { a: [1] }), changed(path, (of, key) => { of[key].push({ a: [1] }); }));
      const parent = path.slice(0, -1).reduce((one, key) => one[key], whole);
      if (Object.keys(parent).length > 1) expect("gone", path, remove(text, path), changed(path, (of, key) => { if (Array.isArray(of)) of.splice(key, 1); else delete of[key]; }));
    }
    if (value && typeof value === "object") for (const key of some(Object.keys(value), Array.isArray(value))) visit(value[key], [...path, Array.isArray(value) ? Number(key) : key]);
  }
  visit(whole, []);
  return { count, wrong };
};

const randomEdits = (seed) => {
  const { editor, scene, state } = optiplanStudio, pick = (list) => list[Math.floor(random() * list.length)];
  const random = () => { seed = (seed * 1103515245 + 12345) % 2147483648; return seed / 2147483648; };
  const first = editor.text();
  const drawn = (act) => { // as if the scene showed this text, of which nothing is asked
    const { valid, drawn } = state;
    Object.assign(state, { valid: editor.text(), drawn: null });
    const before = editor.text();
    act();
    if (editor.text() !== before) written++;
    Object.assign(state, { valid, drawn });
  };
  let edits = 0, written = 0; // all, and those of the scene that changed the text
  while (edits < 1000) {
    const sound = ProblemText.sound(editor.text()), act = sound || random() < 0.3 ? Math.floor(random() * 7) : 5;
    const at = Math.floor(random() * editor.view.state.doc.length);
    const pose = [0.4 + random(), random() - 0.5, random(), 0, 0, Math.sin(random()), 1];
    const { name } = pick(state.problem.scene.obstacles.filter(({ shape }) => "box" in shape)); // a plane has no size
    if (act === 0) editor.view.dispatch({ changes: { from: at, insert: pick(["1", " ", "# word", "\n", "x: {"]) }, userEvent: "input.type" });
    else if (act === 1) editor.view.dispatch({ changes: { from: at, to: Math.min(at + 3, editor.view.state.doc.length) }, userEvent: "delete" });
    else if (act === 2) drawn(() => scene.events.goal(pose, true));
    else if (act === 3) drawn(() => scene.events.obstacle(name, pose));
    else if (act === 4) drawn(() => scene.events.resized(name, { box: [0.1 + random(), 0.2, 0.3] }, pose, true));
    else if (act === 5) for (let k = 0; k < 2 * random(); k++) editor.undo();
    else editor.redo();
    edits++;
  }
  while (editor.undo());
  const undone = editor.text();
  while (editor.redo());
  return { first, undone, steps: CM.undoDepth(editor.view.state), written };
};
