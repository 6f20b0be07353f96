// Speaks texts with the browser's speech synthesis, and remembers whether it is muted.
const KEY = "codebotler-muted";
const LONGEST = 600; // the maximum number of characters of a text

export class Speaker {
  exists = "speechSynthesis" in window && "SpeechSynthesisUtterance" in window;
  isMuted = localStorage.getItem(KEY) === "yes";
  isSpeaking = false;

  /** @param changed called with true when speech begins, and with false when it ends */
  constructor(changed) {
    this.changed = changed;
    this.waiting = 0;
  }

  /** Whether the browser stays silent until somebody touches the page. */
  get waitsForTouch() {
    return this.exists && !this.isMuted && navigator.userActivation?.hasBeenActive === false;
  }

  say(text) {
    if (!this.exists || this.isMuted || this.waitsForTouch || !text.trim()) return;
    const words = new SpeechSynthesisUtterance(text.slice(0, LONGEST));
    words.addEventListener("end", () => this.#count(-1), { once: true });
    words.addEventListener("error", () => this.#count(-1), { once: true });
    this.#count(1);
    speechSynthesis.speak(words);
  }

  hush() {
    if (!this.exists) return;
    speechSynthesis.cancel();
    this.#count(-this.waiting);
  }

  mute(is) {
    this.isMuted = is;
    localStorage.setItem(KEY, is ? "yes" : "no");
    if (is) this.hush();
  }

  #count(more) {
    this.waiting = Math.max(0, this.waiting + more);
    const is = this.waiting > 0;
    if (is === this.isSpeaking) return;
    this.isSpeaking = is;
    this.changed(is);
  }
}
