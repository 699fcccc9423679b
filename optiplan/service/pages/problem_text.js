"use strict";
// Least edits of a problem's text: only what a wish changes is written anew; comments, order, units and notation stay.
// An edit is {from, to, insert}, as CodeMirror takes it; a path is a list of keys and indices into the file.
const ProblemText = (() => {
  const { parseDocument, isMap, isSeq, isScalar, isPair } = CM;
  const plain = /^[A-Za-z_][A-Za-z0-9_./-]*$/, words = new Set(["true", "false", "null", "yes", "no", "on", "off", "y", "n"]);

  const number = (x) => String(Math.abs(x) < 1e-9 ? 0 : Number(x.toPrecision(9)));

  // A value on one line.
  function flow(value) {
    if (Array.isArray(value)) return "[" + value.map(flow).join(", ") + "]";
    if (value && typeof value === "object") return "{" + Object.entries(value).filter(([, one]) => one !== undefined).map(([key, one]) => `${flow(key)}: ${flow(one)}`).join(", ") + "}";
    if (typeof value === "number") return number(value);
    if (typeof value === "string" && plain.test(value) && !words.has(value.toLowerCase())) return value;
    return JSON.stringify(value);
  }

  // The same text is asked about again and again, as by each of many drags: the last document is kept, which nobody changes.
  let last = { text: null, document: null };
  function parse(text) {
    if (text !== last.text) last = { text, document: parseDocument(text, { keepSourceTokens: false, logLevel: "silent" }) };
    return last.document;
  }

  // The node at a path; null where the text has none, or where it is only an alias.
  function at(root, path) {
    let node = root;
    for (const key of path) {
      if (isMap(node)) node = node.get(key, true);
      else if (isSeq(node)) node = node.items[key];
      else return null;
    }
    return node || null;
  }

  const pair = (map, key) => map.items.find((one) => isScalar(one.key) && one.key.value === key);
  const first = (entry) => (isPair(entry) ? entry.key : entry);
  const inLine = (node) => isScalar(node) || node.flow || !node.items || !node.items.length;

  // Where the last sign of a node ends: a block's own range goes on over comments and empty lines.
  function end(node) {
    if (!node) return 0;
    if (inLine(node)) return node.range[1];
    return over(node.items.at(-1));
  }

  // Where an entry of a map or list ends; `key:` without a value ends behind its colon.
  function over(entry) {
    if (!isPair(entry)) return end(entry);
    return entry.value && entry.value.range ? Math.max(entry.key.range[1], end(entry.value)) : entry.key.range[1] + 1;
  }

  const lineEnd = (text, from) => { const found = text.indexOf("\n", from); return found < 0 ? text.length : found; };
  const lineBegin = (text, from) => text.lastIndexOf("\n", from - 1) + 1;
  const column = (text, from) => from - lineBegin(text, from);

  // A new entry after the last one of a map or list.
  function appended(text, node, entry, isList) {
    if (node.flow || !node.items.length) {
      const close = node.range[1] - 1, body = text.slice(node.range[0] + 1, close), stop = node.items.length && over(node.items.at(-1));
      return node.items.length ? [{ from: stop, to: stop, insert: ", " + entry }] : [{ from: node.range[0] + 1, to: node.range[0] + 1 + body.trimEnd().length, insert: entry }];
    }
    const indent = isList ? listColumn(text, node) : column(text, node.items[0].key.range[0]), stop = lineEnd(text, end(node));
    return [{ from: stop, to: stop, insert: "\n" + " ".repeat(indent) + (isList ? "- " : "") + entry }];
  }

  function listColumn(text, node) {
    return column(text, text.lastIndexOf("-", node.items[0].range[0] - 1));
  }

  // Edits that take one entry of a map or list away: with its line, where it has lines of its own.
  function without(text, node, index) {
    const items = node.items, item = items[index];
    let from = first(item).range[0], to = over(item);
    if (node.flow) {
      if (index + 1 < items.length) to = first(items[index + 1]).range[0];
      else if (index > 0) from = over(items[index - 1]);
      return [{ from, to, insert: "" }];
    }
    const begin = lineBegin(text, from);
    if (isMap(node) && text.slice(begin, from).trim()) return index + 1 < items.length ? [{ from, to: items[1].key.range[0], insert: "" }] : [{ from, to, insert: "{}" }];
    return [{ from: begin, to: Math.min(text.length, lineEnd(text, to) + 1), insert: "" }];
  }

  // Edits that make a node say `value`; `undefined` in a map takes a key away.
  function assigned(text, node, value) {
    if (Array.isArray(value) && isSeq(node) && node.items.length === value.length && value.length)
      return value.flatMap((one, k) => assigned(text, node.items[k], one));
    if (value && typeof value === "object" && !Array.isArray(value) && isMap(node) && node.items.length) {
      const edits = [], gone = node.items.map((_, k) => k).filter((k) => value[node.items[k].key.value] === undefined && node.items[k].key.value in value);
      const fresh = Object.entries(value).filter(([key, one]) => one !== undefined && !pair(node, key));
      for (const [key, one] of Object.entries(value)) if (one !== undefined && pair(node, key)) edits.push(...said(text, pair(node, key), one));
      if (gone.length && fresh.length) { // a key takes the place of another
        const [key, one] = fresh.shift(), old = node.items[gone.shift()];
        edits.push({ from: old.key.range[0], to: over(old), insert: `${flow(key)}: ${flow(one)}` });
      }
      for (const k of gone) edits.push(...without(text, node, k));
      if (fresh.length) edits.push(...appended(text, node, fresh.map(([key, one]) => `${flow(key)}: ${flow(one)}`).join(node.flow ? ", " : "\n" + " ".repeat(column(text, node.items[0].key.range[0]))), false));
      return edits;
    }
    if (isScalar(node) && (node.value === value || (typeof value === "number" && typeof node.value === "number" && number(node.value) === number(value)))) return [];
    const [from, to] = [node.range[0], end(node)];
    return [{ from, to, insert: flow(value) }];
  }

  // Of a pair whose value may be missing (`key:` and nothing behind it).
  function said(text, one, value) {
    if (one.value && !(isScalar(one.value) && one.value.value === null)) return assigned(text, one.value, value);
    const after = text.indexOf(":", one.key.range[1]) + 1;
    return [{ from: after, to: one.value ? Math.max(after, one.value.range[1]) : after, insert: " " + flow(value) }];
  }

  // Edits that make the file say `value` at `path`; missing keys on the way are written, missing entries of lists are not.
  function set(text, path, value) {
    const root = parse(text).contents;
    for (let depth = path.length; depth >= 0; depth--) {
      const node = at(root, path.slice(0, depth)), empty = isScalar(node) && node.value === null;
      if (!node || (empty && !isSeq(at(root, path.slice(0, depth - 1))))) continue; // `key:` is written with its key
      if (isSeq(node) && depth < path.length) return [];
      let wish = value;
      for (const key of path.slice(depth).reverse()) wish = { [key]: wish };
      return assigned(text, node, wish);
    }
    const written = path.reduceRight((wish, key) => ({ [key]: wish }), value), stop = text.trimEnd().length;
    return [{ from: stop, to: text.length, insert: (stop ? "\n" : "") + Object.entries(written).map(([key, one]) => `${flow(key)}: ${flow(one)}\n`).join("") }];
  }

  // Edits that put an entry at the end of the list at `path`, which is made where there is none.
  function add(text, path, value) {
    const root = parse(text).contents, list = at(root, path);
    if (isSeq(list)) return appended(text, list, flow(value), true);
    const parent = at(root, path.slice(0, -1));
    if (isMap(parent) && !parent.flow && parent.items.length) {
      const indent = column(text, parent.items[0].key.range[0]), stop = lineEnd(text, end(parent)), inside = " ".repeat(indent);
      const missing = !pair(parent, path.at(-1));
      if (missing) return [{ from: stop, to: stop, insert: `\n${inside}${path.at(-1)}:\n${inside}  - ${flow(value)}` }];
    }
    return set(text, path, [value]);
  }

  // Edits that take away what stands at `path`.
  function remove(text, path) {
    const root = parse(text).contents, parent = at(root, path.slice(0, -1)), key = path.at(-1);
    if (!parent) return [];
    const index = isSeq(parent) ? key : parent.items.findIndex((one) => one.key.value === key);
    if (index < 0 || index >= parent.items.length) return [];
    if (parent.items.length === 1 && path.length > 1) return parent.flow ? without(text, parent, 0) : remove(text, path.slice(0, -1));
    return without(text, parent, index);
  }

  // What stands at `path`, as plain data; undefined where nothing does.
  function value(text, path) {
    const document = parse(text), node = at(document.contents, path);
    return node ? node.toJS(document) : undefined;
  }

  // The text after edits, none of which meets another.
  function applied(text, edits) {
    return [...edits].sort((a, b) => b.from - a.from).reduce((now, { from, to, insert }) => now.slice(0, from) + insert + now.slice(to), text);
  }

  // One edit that turns a text into another: what both have at their begin and end stays.
  function difference(before, after) {
    if (before === after) return [];
    let head = 0, tail = 0;
    const most = Math.min(before.length, after.length);
    while (head < most && before[head] === after[head]) head++;
    while (tail < most - head && before.at(-1 - tail) === after.at(-1 - tail)) tail++;
    return [{ from: head, to: before.length - tail, insert: after.slice(head, after.length - tail) }];
  }

  // Index of the entry called `name` in the list at `path`; -1 where there is none.
  function named(text, path, name) {
    const list = at(parse(text).contents, path);
    return isSeq(list) ? list.items.findIndex((one) => isMap(one) && one.get("name") === name) : -1;
  }

  // Whether the text is YAML with a map at its top: only then are there keys to be edited.
  function sound(text) {
    const document = parse(text);
    return !document.errors.length && isMap(document.contents);
  }

  // Where what stands at `path` begins and ends in the text; null where nothing does.
  function place(text, path) {
    const node = at(parse(text).contents, path);
    return node && [node.range[0], end(node)];
  }

  // The path of keys around a position of the text, outermost first, and the node found there.
  function around(text, position) {
    const path = [];
    let node = parse(text).contents;
    for (;;) {
      const items = isMap(node) || isSeq(node) ? node.items : [];
      const k = items.findIndex((one) => { const range = first(one).range; return range && range[0] <= position && position <= over(one); });
      if (k < 0) return { path, node };
      path.push(isMap(node) ? items[k].key.value : k);
      if (isMap(node) && position <= items[k].key.range[1]) return { path, node: items[k].key };
      node = isMap(node) ? items[k].value : items[k];
      if (!node) return { path, node: null };
    }
  }
  return { set, add, remove, value, sound, applied, difference, named, place, around, flow };
})();
