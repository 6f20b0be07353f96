// STOP: works without the rest of the page, even before it is loaded.
(() => {
  const button = document.getElementById("stop");
  const output = document.getElementById("stop-told");
  const { dataset, src } = document.currentScript;
  const root = new URL("..", src); // relative, because a proxy may add a prefix
  const [stopAt, robotAt] = [new URL(dataset.stop ?? "api/stop", root), new URL(dataset.robot ?? "api/robot", root)];
  const LOST = "CodeBotler is not responding. Use the robot's emergency stop.";
  const REFUSED = "CodeBotler refused to stop. Use the robot's emergency stop.";
  const UNSURE = "Stop sent, but the robot may still move. Watch it, or stop it by hand.";
  const DISCARDED = "Discarded before it ran.";
  const ENDS = {
    stopped: "The robot has stopped.",
    done: "The mission had already ended.",
    interrupted: "The mission was interrupted.",
    null: "Stopped before the mission started.",
  };
  const SHOWN = 8000; // ms
  const PATIENCE = 3000; // ms until the page says that the stop has not been answered
  const LONGEST_POLL = 20_000; // ms, more than the server waits before it answers
  class Refused extends Error {}
  let pressed = 0;
  let showsOutcome = false; // whether the text is about a mission that is over

  const say = (text, kind = "", isOutcome = false) => {
    output.textContent = text;
    showsOutcome = isOutcome;
    output.className = kind;
  };

  const ask = async (wait) =>
    (await fetch(`${robotAt}?once=${wait}`, { signal: AbortSignal.timeout(LONGEST_POLL) })).json();

  const watch = async (which) => {
    for (;;) {
      const now = await ask("over");
      if (which !== pressed) return;
      if (now.is_over) {
        const failed = now.reason ? `The mission failed: ${now.reason}` : "The mission failed.";
        const isDiscarded = now.state === "stopped" && now.has_begun === false;
        const text = isDiscarded ? DISCARDED : (ENDS[now.state] ?? failed);
        say(text, now.state === "failed" ? "bad" : "good", true);
        return;
      }
    }
  };

  const stop = async (onlyMoving) => {
    const which = ++pressed;
    if (!onlyMoving) say("Sending the stop …", "busy");
    const late = setTimeout(() => which === pressed && say(LOST, "bad"), PATIENCE);
    try {
      const answer = await fetch(`${stopAt}?only_moving=${onlyMoving}`, { method: "POST" });
      const { stopping, warning, detail } = await answer.json();
      clearTimeout(late);
      if (!answer.ok) throw new Refused(detail);
      if (warning) {
        say(UNSURE, "bad");
      } else if (stopping) {
        say("Stop sent. Waiting for the robot to confirm …", "busy");
        await watch(which);
      } else if (!onlyMoving || output.textContent === LOST) {
        say("Nothing is running.", "", true);
      }
    } catch (error) {
      clearTimeout(late);
      say(error instanceof Refused ? `${REFUSED} (${error.message})` : LOST, "bad");
    }
    const lasts = () => output.classList.contains("bad") && output.textContent !== UNSURE; // the page warns, too
    setTimeout(() => which === pressed && !lasts() && say(""), SHOWN);
    await clearOnceBegun(which);
  };

  /** Clear the outcome of a mission when the next one begins. */
  const clearOnceBegun = async (which) => {
    try {
      while (which === pressed && showsOutcome) {
        const now = await ask("begun");
        if (which === pressed && showsOutcome && !now.is_over) say("");
      }
    } catch {
      // Without a connection, no mission can begin, so the text stays true.
    }
  };

  button.addEventListener("click", () => stop(false));
  window.addEventListener(
    "keydown",
    (event) => event.key === "Escape" && !event.isComposing && !event.repeat && stop(true),
    true,
  );
})();
