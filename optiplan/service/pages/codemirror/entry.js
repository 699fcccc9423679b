// What codemirror.min.js is made of. To make it anew, in a folder with this file:
//   npm install codemirror@6 @codemirror/lang-yaml@6 @lezer/highlight@1 yaml@2 esbuild
//   npx esbuild entry.js --bundle --minify --format=iife --global-name=CM --target=es2020 --legal-comments=none --outfile=codemirror.min.js
export { EditorState, Transaction, Annotation, StateEffect, Compartment } from "@codemirror/state";
export { EditorView, keymap, lineNumbers, highlightActiveLine, highlightActiveLineGutter, drawSelection, hoverTooltip } from "@codemirror/view";
export { history, historyKeymap, defaultKeymap, indentWithTab, undo, redo, undoDepth, redoDepth, isolateHistory } from "@codemirror/commands";
export { foldGutter, foldKeymap, indentUnit, syntaxHighlighting, HighlightStyle, bracketMatching } from "@codemirror/language";
export { autocompletion, completionKeymap, startCompletion } from "@codemirror/autocomplete";
export { lintGutter, setDiagnostics, nextDiagnostic } from "@codemirror/lint";
export { searchKeymap, highlightSelectionMatches } from "@codemirror/search";
export { yaml } from "@codemirror/lang-yaml";
export { tags } from "@lezer/highlight";
export { parseDocument, isMap, isSeq, isScalar, isPair } from "yaml";
