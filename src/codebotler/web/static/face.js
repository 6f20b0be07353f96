// The robot's face: shows the data of /api/face/live and sends answers. Texts are never interpreted as markup.
import { Speaker } from "./speaker.js";
import { Listener } from "./listener.js";

const $ = (id) => document.getElementById(id);
const WELCOME = "Hello. I have nothing to do right now.";
const LOST = "The robot cannot be reached. Trying again …";
const API = new URL("../api/face/", import.meta.url); // relative, because a proxy may add a prefix
const SETTLE = 400; // ms during which a new question ignores touches meant for the previous one
const AGAIN = 1000; // ms before reconnecting

let now = null; // the latest data
let late = 0; // when the question expires
let seen = 0; // the number of the latest statement or question
let proposed = null; // an answer by voice that is not confirmed yet

const speaker = new Speaker((is) => {
  document.body.classList.toggle("speaks", is);
  listen();
});
const listener = new Listener(heard, (trouble) => {
  $("voice").setAttribute("aria-checked", "false");
  $("ended").textContent = trouble;
});

const put = (id, text) => {
  if ($(id).textContent !== text) $(id).textContent = text;
  $(id).hidden = !text;
};

const sized = (element, text) => {
  element.dataset.size = text.length < 60 ? "large" : text.length < 220 ? "middle" : "small";
};

const ENDS = { done: "I have finished.", stopped: "I was stopped.", failed: "Something went wrong, and I gave up." };
const doingWords = ({ doing, to, state, reason }) => {
  const rests = reason || ENDS[state] || WELCOME;
  return { idle: rests, moving: to ? `On my way to ${to}` : "On my way", working: "Working …", asking: "" }[doing];
};

function show(data) {
  const before = now;
  now = data;
  document.body.dataset.doing = data.doing;
  document.body.dataset.ended = (data.is_over && data.state) || "";
  put("doing", doingWords(data));
  showSaid(data.said);
  if (data.question?.number !== before?.question?.number) ask(data.question);
  late = performance.now() + 1000 * (data.seconds_left ?? Infinity);
  put("ended", ending(data));
  const isNew = before !== null; // do not repeat what was said before this page was opened
  for (const { number, text } of data.said) {
    if (number > seen && isNew) speaker.say(text);
    seen = Math.max(seen, number);
  }
  if (data.question && data.question.number > seen) {
    seen = data.question.number;
    speaker.say(`${data.question.text} ${data.question.options.join(", ")}`);
  }
  if (before?.question && !data.question) speaker.hush();
  if (before && !before.is_over && data.is_over && data.state === "stopped") speaker.hush();
}

function showSaid(said) {
  const kept = new Map([...$("said").children].map((each) => [Number(each.dataset.number), each]));
  const lines = said.map(({ number, text }) => {
    const line = kept.get(number) ?? document.createElement("p");
    line.dataset.number = number;
    line.dir = "auto";
    sized(line, text);
    if (line.textContent !== text) line.textContent = text;
    return line;
  });
  if (lines.length !== kept.size || lines.some((line) => !line.isConnected)) $("said").replaceChildren(...lines);
  $("said").hidden = said.length === 0;
}

function ask(question) {
  propose(null);
  $("asked").hidden = question === null;
  put("person", question?.person ? `For ${question.person}` : "");
  put("question", question === null ? "" : question.text || "?");
  put("more", question?.more_options ? `${question.more_options} more answers are not shown.` : "");
  sized($("question"), $("question").textContent);
  const options = question?.options.map((text, position) => option(question, text, position)) ?? [];
  $("options").replaceChildren(...options);
  $("announce").textContent = question === null ? "" : `The robot asks: ${question.text}`;
  listen();
}

function option(question, text, position) {
  const button = document.createElement("button");
  const [key, words] = [document.createElement("kbd"), document.createElement("span")];
  button.type = "button";
  button.disabled = true;
  setTimeout(() => (button.disabled = false), SETTLE);
  key.textContent = position < 9 ? position + 1 : "";
  words.textContent = text.trim() ? text : "(blank)";
  words.dir = "auto";
  sized(button, text);
  button.append(key, words);
  if (position < 9) button.setAttribute("aria-keyshortcuts", position + 1);
  button.addEventListener("click", () => answer(question, position));
  return button;
}

async function answer(question, position) {
  for (const button of $("options").children) button.disabled = true;
  let error = "";
  try {
    const body = JSON.stringify({ question: question.number, option: position });
    const headers = { "Content-Type": "application/json" };
    const reply = await fetch(new URL("answer", API), { method: "POST", headers, body });
    if (!reply.ok) error = `The answer was not accepted: ${(await reply.json()).detail}`;
  } catch {
    error = LOST;
  }
  if (error) {
    put("ended", error);
    for (const button of $("options").children) button.disabled = false;
  }
}

function ending({ question, ended, said }) {
  if (question || !ended || said.some(({ number }) => number > ended.number)) return "";
  if (ended.how === "answered") return `Thank you: ${ended.answer}`;
  return ended.how === "withdrawn" ? "The question was withdrawn." : "Nobody answered in time.";
}

// --- by voice

function listen() {
  const isOn = $("voice").getAttribute("aria-checked") === "true";
  const isFree = now?.question && !proposed && !speaker.isSpeaking;
  if (isOn && isFree) listener.start(now.question.options);
  else listener.stop();
}

function heard(text, position) {
  if (!now?.question) return;
  propose({ question: now.question, text, position });
}

function propose(answer) {
  proposed = answer?.position === undefined || answer.position < 0 ? null : answer;
  $("heard").hidden = answer === null;
  $("take").hidden = $("leave").hidden = proposed === null;
  if (answer === null) return;
  const option = proposed && answer.question.options[answer.position];
  $("heard-text").textContent = proposed
    ? `I heard “${answer.text}”. Is your answer “${option}”?`
    : `I heard “${answer.text}”, which is not one of the answers. Please try again.`;
  if (proposed) $("take").focus();
}

$("take").addEventListener("click", () => {
  const { question, position } = proposed;
  propose(null);
  answer(question, position);
});
$("leave").addEventListener("click", () => {
  propose(null);
  listen();
});

// --- switches and keys

const turn = (id, on) => $(id).setAttribute("aria-checked", String(on));
const hint = () => ($("hint").hidden = !speaker.waitsForTouch);

if (speaker.exists) {
  turn("aloud", !speaker.isMuted);
  $("aloud").addEventListener("click", () => {
    speaker.mute(!speaker.isMuted);
    turn("aloud", !speaker.isMuted);
    hint();
  });
} else {
  $("aloud").hidden = true;
}
hint();
for (const kind of ["pointerup", "keyup"]) addEventListener(kind, hint);

if (Listener.exists) {
  $("voice").hidden = $("voice-about").hidden = false;
  $("voice").addEventListener("click", () => {
    turn("voice", $("voice").getAttribute("aria-checked") !== "true");
    listen();
  });
}

addEventListener("keydown", (event) => {
  if (event.repeat || event.ctrlKey || event.altKey || event.metaKey || !/^[1-9]$/.test(event.key)) return;
  $("options").children[Number(event.key) - 1]?.click();
});

setInterval(() => {
  const left = Math.max(0, Math.ceil((late - performance.now()) / 1000));
  $("left").textContent = now?.question && Number.isFinite(left) ? `${left} s left to answer` : "";
}, 250);

// --- the connection

function connect() {
  const socket = new WebSocket(new URL("live", API).href.replace("http", "ws"));
  socket.addEventListener("message", ({ data }) => show(JSON.parse(data)));
  socket.addEventListener("close", () => {
    document.body.dataset.doing = "lost";
    document.body.dataset.ended = "";
    put("doing", LOST);
    ask(null);
    now = null; // a restarted server counts from 1 again
    seen = 0;
    setTimeout(connect, AGAIN);
  });
}

connect();
navigator.wakeLock?.request("screen").catch(() => {});
