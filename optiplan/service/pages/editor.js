"use strict";
// The problem's text: CodeMirror with line numbers, folding, the schema's words, and problems in the margin.
// Every change of the scene is an edit of the text in the same history as typing, so that undo takes both back in order.
const Editor = (() => {
  const { EditorView, EditorState, Transaction, tags } = CM;
  const DEEP = 100000; // steps of undo kept
  const colours = CM.HighlightStyle.define([
    { tag: [tags.propertyName, tags.definition(tags.propertyName)], color: "var(--key)" },
    { tag: tags.comment, color: "var(--soft)", fontStyle: "italic" },
    { tag: [tags.string, tags.content], color: "var(--ink)" },
    { tag: [tags.punctuation, tags.separator, tags.squareBracket, tags.brace], color: "var(--soft)" },
  ]);

  class Text {
    // changed(text, byHand) after every change; `words` completes and explains keys, from the problem's schema.
    constructor(host, changed, words) {
      this.view = new EditorView({ parent: host, state: this.begun("", changed, words) });
      this.view.scrollDOM.tabIndex = 0; // the keyboard scrolls it, too
      this.begin = (text) => this.view.setState(this.begun(text, changed, words));
    }

    begun(text, changed, words) {
      return EditorState.create({ doc: text, extensions: [
        CM.lineNumbers(), CM.foldGutter(), CM.lintGutter(), CM.highlightActiveLine(), CM.highlightActiveLineGutter(), CM.bracketMatching(),
        CM.history({ minDepth: DEEP }), CM.yaml(), CM.indentUnit.of("  "), CM.syntaxHighlighting(colours), CM.highlightSelectionMatches(),
        CM.autocompletion({ override: [words.complete] }), CM.hoverTooltip(words.explain), EditorState.lineSeparator.of("\n"),
        CM.keymap.of([...CM.completionKeymap, ...CM.historyKeymap, ...CM.foldKeymap, ...CM.searchKeymap, ...CM.defaultKeymap, CM.indentWithTab]),
        EditorView.contentAttributes.of({ "aria-label": "Problem file, YAML", spellcheck: "false" }),
        EditorView.updateListener.of((update) => {
          if (update.docChanged) changed(this.text(), !update.transactions.some((one) => one.isUserEvent("scene")));
        }),
      ] });
    }

    text() { return this.view.state.sliceDoc(); }

    // One step of the history, apart from what is typed before and after.
    edit(edits, shown = false) {
      if (!edits.length) return;
      this.view.dispatch({ changes: edits, annotations: [Transaction.userEvent.of("scene"), CM.isolateHistory.of("full")] });
      if (shown) this.show([edits[0].from, edits[0].from]);
    }

    // Another text as one step that undo takes back.
    replace(text) {
      const { state } = this.view;
      this.view.dispatch({ changes: { from: 0, to: state.doc.length, insert: text }, selection: { anchor: 0 }, annotations: CM.isolateHistory.of("full"), scrollIntoView: true });
    }

    undo() { return CM.undo(this.view); }
    redo() { return CM.redo(this.view); }

    show([from, to]) {
      this.view.dispatch({ selection: { anchor: from, head: to }, effects: EditorView.scrollIntoView(from, { y: "center" }) });
    }

    goTo(line) {
      const { from, to } = this.view.state.doc.line(Math.min(line, this.view.state.doc.lines));
      this.show([from, to]);
      this.view.focus();
    }

    // Marks lines in the margin: {line, words} of each; a problem without a line marks none.
    mark(problems) {
      const { doc } = this.view.state;
      const marks = problems.filter((one) => one.line !== null).map(({ line, words }) => {
        const { from, to, text } = doc.line(Math.min(Math.max(1, line), doc.lines));
        return { from: from + (text.length - text.trimStart().length), to, severity: "error", message: words };
      });
      this.view.dispatch(CM.setDiagnostics(this.view.state, marks));
    }
  }
  return { Text };
})();
