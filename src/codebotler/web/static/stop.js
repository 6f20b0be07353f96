// STOP: needs nothing of the rest of the page, and works before that is there.
(() => {
  const button = document.getElementById("stop");
  const told = document.getElementById("stop-told");
  const { stop: stopAt = "/api/stop", robot: robotAt = "/api/robot" } = document.currentScript.dataset;
  const LOST = "CodeBotler is not responding. Use the robot's emergency stop.";
  const DISCARDED = "Discarded; the robot had not moved.";
  const ENDS = {
    stopped: "The robot has stopped.",
    done: "The mission had already ended.",
    interrupted: "The mission was interrupted.",
    null: "Stopped before the mission started.",
  };
  let pressed = 0;

  const say = (text, kind = "") => {
    told.textContent = text;
    told.className = kind;
  };

  const watch = async (which) => {
    for (;;) {
      const now = await (await fetch(`${robotAt}?once_over=true`)).json();
      if (which !== pressed) return;
      if (now.is_over) {
        const failed = now.reason ? `The mission failed: ${now.reason}` : "The mission failed.";
        const isDiscarded = now.state === "stopped" && now.has_begun === false;
        const text = isDiscarded ? DISCARDED : (ENDS[now.state] ?? failed);
        say(text, now.state === "failed" ? "bad" : "good");
        return;
      }
    }
  };

  const stop = async (onlyMoving) => {
    const which = ++pressed;
    if (!onlyMoving) say("Telling the robot to stop …", "busy");
    try {
      const answer = await fetch(`${stopAt}?only_moving=${onlyMoving}`, { method: "POST" });
      if (!answer.ok) throw new Error(answer.status);
      const { stopping } = await answer.json();
      if (stopping) {
        say("Stop sent. Waiting for the robot to confirm …", "busy");
        await watch(which);
      } else if (!onlyMoving) {
        say("Nothing is running.");
      }
    } catch {
      say(LOST, "bad");
    }
    setTimeout(() => which === pressed && !told.classList.contains("bad") && say(""), 8000);
  };

  button.addEventListener("click", () => stop(false));
  window.addEventListener(
    "keydown",
    (event) => event.key === "Escape" && !event.isComposing && !event.repeat && stop(true),
    true,
  );
})();
