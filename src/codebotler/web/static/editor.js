// The program in the editor: sends what is typed, shows what the tool has, and lets neither undo the other.
globalThis.programEditor = (() => {
  const PAUSE = 300; // milliseconds without a key, after which what was typed is sent
  let editor; // NiceGUI's component, once it is there
  let latest; // what the tool said last
  let sent = 0; // how many texts were sent
  let waiting; // the timer of one that will be

  const text = () => editor.editor.state.doc.toString();

  const send = () => {
    if (!editor) return typed();
    waiting = undefined;
    emitEvent("program-typed", { text: text(), number: ++sent });
  };

  function typed() {
    clearTimeout(waiting);
    waiting = setTimeout(send, PAUSE);
  }

  const apply = () => {
    editor.setDisabled(!latest.editable);
    const isOlder = waiting !== undefined || latest.heard < sent;
    if (isOlder && !latest.anyway) return; // the tool answers each text, and that answer is newer
    clearTimeout(waiting);
    waiting = undefined;
    editor.setEditorValue(latest.program);
    editor.setDecorations(latest.marks);
  };

  const show = (what) => {
    latest = what;
    if (editor) apply();
  };

  const start = async (id) => {
    while (!getElement(id)?.editor) await new Promise((later) => setTimeout(later, 20));
    editor = getElement(id);
    const dark = matchMedia("(prefers-color-scheme: dark)");
    const colour = () => editor.setTheme(dark.matches ? "vscodeDark" : "vscodeLight");
    dark.addEventListener("change", colour);
    colour();
    // What people need who see no screen, or use no mouse, and CodeMirror does not offer.
    editor.$el.querySelector(".cm-content").setAttribute("aria-label", "Program");
    editor.$el.querySelector(".cm-scroller").setAttribute("tabindex", "0");
    if (latest) apply();
  };

  return { show, start, text, typed };
})();
