// Hears an answer with the browser's own speech recognition. The options are the vocabulary; nothing is taken here.
const Recognition = window.SpeechRecognition ?? window.webkitSpeechRecognition;
const TROUBLES = {
  "not-allowed": "The browser does not let this page listen. Please choose by touch.",
  "service-not-allowed": "The browser does not let this page listen. Please choose by touch.",
  "audio-capture": "There is no microphone. Please choose by touch.",
  network: "The browser cannot understand speech just now. Please choose by touch.",
};

/** Letters and digits, in one form, with single spaces. */
const plain = (text) =>
  text
    .normalize("NFKD")
    .replace(/\p{M}/gu, "")
    .toLowerCase()
    .replace(/[^\p{L}\p{N}]+/gu, " ")
    .trim();

/** The position of the only option that was said; -1 where none or several were. */
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
   * @param heard told what was heard, and the position of the option that was meant, or -1
   * @param failed told in a sentence why nothing can be heard
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
      if (!(error in TROUBLES)) return;
      this.stop();
      this.failed(TROUBLES[error]);
    });
    now.addEventListener("end", () => {
      if (this.now !== now) return; // it was stopped
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
