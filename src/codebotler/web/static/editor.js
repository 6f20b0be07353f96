// The editor: sends typed text to the server, and shows the server's program without overwriting newer text.
globalThis.programEditor = (() => {
  const PAUSE = 300; // ms without a key press before typed text is sent
  const MOST = 200_000; // characters that the server accepts
  const PLACEHOLDER = `Or type a program, such as

def task_program():
    for room in get_all_rooms():
        go_to(room)
        say("Hello")`;
  let editor; // NiceGUI's component, once it is loaded
  let latest; // the latest state from the server
  let replacedAt = -1e9; // when this page showed a program in place of another one, in ms
  let sent = 0; // the number of texts sent
  let waiting; // the timer for sending the next text
  let base = ""; // the server's program on which local edits are based

  const text = () => editor.editor.state.doc.toString();

  const send = () => {
    if (!editor) return typed();
    clearTimeout(waiting);
    waiting = undefined;
    const now = text();
    const isTooLong = now.length > MOST;
    emitEvent("program-typed", { text: isTooLong ? null : now, base, number: ++sent });
    if (!isTooLong) base = now;
  };

  function typed() {
    clearTimeout(waiting);
    waiting = setTimeout(send, PAUSE);
  }

  const apply = () => {
    editor.setDisabled(!latest.editable);
    const isOlder = waiting !== undefined || latest.received < sent;
    if (isOlder && !latest.force) return; // the server has not yet answered the newest text
    clearTimeout(waiting);
    waiting = undefined;
    base = latest.program;
    put(latest.program);
    editor.setDecorations(latest.marks);
  };

  /** Replace only the part that differs, so that cursors stay in place. Local undo skips this change. */
  const put = (program) => {
    const [view, old] = [editor.editor, text()];
    if (old === program) return;
    let start = 0;
    while (start < old.length && old[start] === program[start]) start++;
    let [to, end] = [old.length, program.length];
    while (to > start && end > start && old[to - 1] === program[end - 1]) [to, end] = [to - 1, end - 1];
    const { addToHistory } = view.state.update({}).constructor;
    editor.emitting = false;
    view.dispatch({ changes: { from: start, to, insert: program.slice(start, end) }, annotations: addToHistory.of(false) });
    editor.emitting = true;
  };

  /** Send pending text at once, and return what the page shows. */
  const settle = () => {
    if (waiting !== undefined) send();
    return { text: editor && text(), approval: latest?.approval, age: performance.now() - replacedAt };
  };

  const show = (state) => {
    if (latest && state.replaced !== latest.replaced) replacedAt = performance.now();
    latest = state;
    if (editor) apply();
  };

  const start = async (id) => {
    while (!getElement(id)?.editor || !latest) await new Promise((later) => setTimeout(later, 20));
    editor = getElement(id);
    const dark = matchMedia("(prefers-color-scheme: dark)");
    const setTheme = () => editor.setTheme(dark.matches ? "vscodeDark" : "vscodeLight");
    dark.addEventListener("change", setTheme);
    setTheme();
    // Accessibility that CodeMirror lacks: a label for screen readers and scrolling by keyboard.
    editor.$el.querySelector(".cm-content").setAttribute("aria-label", "Program");
    editor.$el.querySelector(".cm-content").setAttribute("aria-placeholder", PLACEHOLDER);
    editor.$el.querySelector(".cm-scroller").setAttribute("tabindex", "0");
    if (latest) apply();
    editor.$el.setAttribute("data-started", "");
  };

  return { settle, show, start, text, typed };
})();
