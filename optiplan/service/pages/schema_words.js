"use strict";
// What the problem's JSON Schema says at a place of the text: the keys that may stand there, their values and meaning.
const SchemaWords = (() => {
  const PROBE = "q_q";
  // All forms that a schema allows, with references followed: [{properties, items, enum, ...}].
  function forms(schema, root) {
    if (!schema) return [];
    if (schema.$ref) return forms({ ...schema.$ref.slice(2).split("/").reduce((one, key) => one && one[key], root), ...(schema.description ? { description: schema.description } : {}) }, root);
    const several = schema.anyOf || schema.oneOf || schema.allOf;
    const own = schema.properties ? [schema] : [];  // a whole file has keys, and one of several sets of required ones
    return several ? [...own, ...several.flatMap((one) => forms(one, root))] : [schema];
  }

  // The schema of one entry below.
  function below(schema, key, root) {
    return forms(schema, root).map((form) => (typeof key === "number" ? form.items || (form.prefixItems || [])[key] : (form.properties || {})[key] || (typeof form.additionalProperties === "object" ? form.additionalProperties : null))).filter(Boolean);
  }

  function reached(path, root) {
    return path.reduce((schemas, key) => schemas.flatMap((one) => below(one, key, root)), [root]);
  }

  function kind(form) {
    if (form.enum) return form.enum.map(String).join(" | ");
    if (form.const !== undefined) return String(form.const);
    if (form.type === "array") return form.items && form.items.type ? `list of ${form.items.type}s` : "list";
    return form.type === "object" ? "map" : form.type || "";
  }

  const said = (schema, root) => {
    const all = forms(schema, root), kinds = [...new Set(all.map(kind).filter((one) => one && one !== "null"))];
    return { detail: kinds.slice(0, 3).join(", "), words: schema.description || (all.find((one) => one.description) || {}).description || "" };
  };

  const values = (schemas, root) => [...new Set(schemas.flatMap((one) => forms(one, root)).flatMap((form) => form.enum || (form.const !== undefined ? [form.const] : form.type === "boolean" ? [true, false] : [])))];

  // `root`: a promise of the schema; `names(path)`: further values where the schema allows any text (robots, planners).
  function from(promised, names = () => []) {
    let root = null;
    promised.then((schema) => { root = schema; });

    function complete(context) {
      if (!root) return null;
      const word = context.matchBefore(/[A-Za-z_][\w-]*/), from = word ? word.from : context.pos;
      if (!word && !context.explicit) return null;
      const line = context.state.doc.lineAt(context.pos), before = line.text.slice(0, from - line.from);
      const value = /[\w-]:\s+$/.test(before);
      const path = parents(context.state.sliceDoc(), from, context.pos, Boolean(value)), schemas = reached(path, root);
      if (value) return { from, options: [...values(schemas, root), ...names(path)].map((one) => ({ label: String(one), type: "constant" })) };
      const properties = schemas.flatMap((one) => forms(one, root)).flatMap((form) => Object.entries(form.properties || {}));
      const options = [...new Map(properties).entries()].map(([label, one]) => ({ label, apply: label + ": ", type: "property", detail: said(one, root).detail, info: said(one, root).words || undefined }));
      return options.length ? { from, options, validFor: /^[\w-]*$/ } : null;
    }

    function explain(view, position) {
      const word = root && view.state.wordAt(position), found = word && ProblemText.around(view.state.sliceDoc(), position);
      if (!found || !found.path.length) return null;
      const schema = reached(found.path, root)[0];
      if (!schema) return null;
      const { detail, words } = said(schema, root);
      if (!words && !detail) return null;
      return { pos: word.from, end: word.to, above: true, create: () => ({ dom: Page.make("div", { className: "word" }, Page.make("b", { textContent: found.path.at(-1) + (detail ? ": " + detail : "") }), Page.make("div", { textContent: words })) }) };
    }
    return { complete, explain };
  }

  // Keys around a place that is being typed: those around a word that is put there, so that what is half written can be read.
  function parents(text, from, to, isValue) {
    const { path } = ProblemText.around(text.slice(0, from) + (isValue ? PROBE : `${PROBE}: ${PROBE}`) + text.slice(to), from);
    return isValue ? path : path.slice(0, -1);
  }
  return { from, parents };
})();
