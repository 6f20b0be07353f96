// Recognizes a spoken option with the browser's speech recognition; face.js asks people to confirm it.
const Recognition = window.SpeechRecognition ?? window.webkitSpeechRecognition;
const ERRORS = {
  "not-allowed": "The browser blocks the microphone. Please tap an answer.",
  "service-not-allowed": "The browser blocks speech recognition. Please tap an answer.",
  "audio-capture": "There is no microphone. Please tap an answer.",
  network: "Speech recognition is not available right now. Please tap an answer.",
};

/** Normalize to lower-case letters and digits, separated by single spaces. */
const plain = (text) =>
  text
    .normalize("NFKD")
    .replace(/\p{M}/gu, "")
    .toLowerCase()
    .replace(/[^\p{L}\p{N}]+/gu, " ")
    .trim();

/** Return the position of the only matching option, or -1 if none or several match. */
export function match(heard, options) {
  const words = options.map(plain);
  for (const one of heard.map(plain)) {
    const same = words.indexOf(one);
    if (one && same >= 0) return same;
  }
  for (const one of heard.map(plain)) {
    const inside = words.flatMap((word, at) => (word && ` ${one} `.includes(` ${word} `) ? [at] : []));
    const widest = inside.filter((at) => !inside.some((other) => other !== at && words[other].includes(words[at])));
    if (widest.length === 1) return widest[0];
  }
  return -1;
}

export class Listener {
  static exists = Boolean(Recognition);

  /**
   * @param heard called with the recognized text and the position of its option, or -1
   * @param failed called with a sentence if recognition is impossible
   */
  constructor(heard, failed) {
    this.heard = heard;
    this.failed = failed;
    this.now = null;
    this.options = [];
  }

  start(options) {
    this.options = options;
    if (this.now !== null) return;
    const now = (this.now = new Recognition());
    now.lang = navigator.language;
    now.maxAlternatives = 5;
    now.interimResults = false;
    now.addEventListener("result", ({ results }) => this.#take(results[results.length - 1]));
    now.addEventListener("error", ({ error }) => {
      if (!(error in ERRORS)) return;
      this.stop();
      this.failed(ERRORS[error]);
    });
    now.addEventListener("end", () => {
      if (this.now !== now) return; // stopped
      this.now = null;
      setTimeout(() => this.now === null && this.isWanted && this.start(this.options), 250);
    });
    this.isWanted = true;
    now.start();
  }

  stop() {
    const now = this.now;
    this.now = null;
    this.isWanted = false;
    now?.abort();
  }

  #take(result) {
    const heard = [...result].map(({ transcript }) => transcript);
    const position = match(heard, this.options);
    if (position >= 0) this.stop();
    this.heard(heard[0], position);
  }
}
