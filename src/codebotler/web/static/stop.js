// STOP: needs nothing of the rest of the page, and works before that is there.
(() => {
  const button = document.getElementById("stop");
  const told = document.getElementById("stop-told");
  const { dataset, src } = document.currentScript;
  const root = new URL("..", src); // also behind a proxy, where addresses have a prefix
  const [stopAt, robotAt] = [new URL(dataset.stop ?? "api/stop", root), new URL(dataset.robot ?? "api/robot", root)];
  const LOST = "CodeBotler is not responding. Use the robot's emergency stop.";
  const REFUSED = "CodeBotler refused to stop. Use the robot's emergency stop.";
  const DISCARDED = "Discarded; the robot had not moved.";
  const ENDS = {
    stopped: "The robot has stopped.",
    done: "The mission had already ended.",
    interrupted: "The mission was interrupted.",
    null: "Stopped before the mission started.",
  };
  const SHOWN = 8000; // ms
  class Refused extends Error {}
  let pressed = 0;

  let tellsEnd = false; // whether the text is about a mission that is over

  const say = (text, kind = "", isEnd = false) => {
    told.textContent = text;
    tellsEnd = isEnd;
    told.className = kind;
  };

  const ask = async (wait) => (await fetch(`${robotAt}?${wait}=true`)).json();

  const watch = async (which) => {
    for (;;) {
      const now = await ask("once_over");
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
    if (!onlyMoving) say("Telling the robot to stop …", "busy");
    try {
      const answer = await fetch(`${stopAt}?only_moving=${onlyMoving}`, { method: "POST" });
      const { stopping, detail } = await answer.json();
      if (!answer.ok) throw new Refused(detail);
      if (stopping) {
        say("Stop sent. Waiting for the robot to confirm …", "busy");
        await watch(which);
      } else if (!onlyMoving) {
        say("Nothing is running.", "", true);
      }
    } catch (error) {
      say(error instanceof Refused ? `${REFUSED} (${error.message})` : LOST, "bad");
    }
    setTimeout(() => which === pressed && !told.classList.contains("bad") && say(""), SHOWN);
    await clearOnceBegun(which);
  };

  /** How a mission ended is out of date when the next one begins. */
  const clearOnceBegun = async (which) => {
    try {
      while (which === pressed && tellsEnd) {
        const now = await ask("once_begun");
        if (which === pressed && tellsEnd && !now.is_over) say("");
      }
    } catch {
      // Without a connection, no mission can begin; the text stays true.
    }
  };

  button.addEventListener("click", () => stop(false));
  window.addEventListener(
    "keydown",
    (event) => event.key === "Escape" && !event.isComposing && !event.repeat && stop(true),
    true,
  );
})();
