"""Stand-ins for what a browser without a voice and without a microphone lacks."""

SPEAKING = """
(() => {
  // A stand-in for the browser's speech synthesis: keeps what it is to say, and has said it a moment later.
  window.spoken = [];
  window.hushed = 0;
  window.SpeechSynthesisUtterance = class extends EventTarget {
    constructor(text) { super(); this.text = text; }
  };
  const standIn = {
    speak(words) {
      window.spoken.push(words.text);
      setTimeout(() => words.dispatchEvent(new Event("end")), 30);
    },
    cancel() { window.hushed += 1; },
  };
  Object.defineProperty(window, "speechSynthesis", { value: standIn });
  Object.defineProperty(navigator, "userActivation", { value: { hasBeenActive: true } });
})();
"""
"""A stubbed speechSynthesis: no sound comes out of it."""

HEARING = """
(() => {
  // A stand-in for the browser's speech recognition: has heard what a test says by window.hear(...).
  window.listening = [];
  const tell = (name, what) => {
    for (const each of [...window.listening]) each.dispatchEvent(Object.assign(new Event(name), what));
  };
  window.SpeechRecognition = class extends EventTarget {
    start() { window.listening.push(this); }
    abort() { window.listening = window.listening.filter((each) => each !== this); }
  };
  window.hear = (...heard) => tell("result", { results: [heard.map((transcript) => ({ transcript }))] });
  window.fail = (error) => tell("error", { error });
})();
"""
"""A stubbed SpeechRecognition: no microphone and no understanding; it has heard what it is told."""

MUTE = (
    "delete window.speechSynthesis; delete window.SpeechRecognition; delete window.webkitSpeechRecognition;"
)
"""A browser that can neither speak nor listen."""
