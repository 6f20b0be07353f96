// The program in the editor: sends what is typed, shows what the tool has, and lets neither undo the other.
globalThis.programEditor = (() => {
  const PAUSE = 300; // milliseconds without a key, after which what was typed is sent
  const MOST = 200_000; // characters; the tool takes no more, and tells so
  const PLACEHOLDER = `Or type a program, such as

def task_program():
    for room in get_all_rooms():
        go_to(room)
        say("Hello")`;
  let editor; // NiceGUI's component, once it is there
  let latest; // what the tool said last
  let sent = 0; // how many texts were sent
  let waiting; // the timer of one that will be
  let base = ""; // the program that was changed here: what the tool has, unless somebody else changed it too

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
    const isOlder = waiting !== undefined || latest.heard < sent;
    if (isOlder && !latest.anyway) return; // the tool answers each text, and that answer is newer
    clearTimeout(waiting);
    waiting = undefined;
    base = latest.program;
    put(latest.program);
    editor.setDecorations(latest.marks);
  };

  /** Only what differs, so that cursors stay; and undoing is for what was typed here. */
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

  /** What is shown, and how many texts were sent; what was just typed goes at once. */
  const settle = () => {
    if (waiting !== undefined) send();
    return { text: text(), number: sent };
  };

  const show = (what) => {
    latest = what;
    if (editor) apply();
  };

  const start = async (id) => {
    while (!getElement(id)?.editor || !latest) await new Promise((later) => setTimeout(later, 20));
    editor = getElement(id);
    const dark = matchMedia("(prefers-color-scheme: dark)");
    const colour = () => editor.setTheme(dark.matches ? "vscodeDark" : "vscodeLight");
    dark.addEventListener("change", colour);
    colour();
    // What people need who see no screen, or use no mouse, and CodeMirror does not offer.
    editor.$el.querySelector(".cm-content").setAttribute("aria-label", "Program");
    editor.$el.querySelector(".cm-content").setAttribute("aria-placeholder", PLACEHOLDER);
    editor.$el.querySelector(".cm-scroller").setAttribute("tabindex", "0");
    if (latest) apply();
    editor.$el.setAttribute("data-started", "");
  };

  return { settle, show, start, text, typed };
})();
