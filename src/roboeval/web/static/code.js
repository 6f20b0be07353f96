// Shows a program with line numbers and coloured syntax. Everything is inserted as text.
const MOST_COLOURED = 100_000;

// The text may be invalid Python, for example with unterminated strings.
const words = (keywords, skills) =>
  new RegExp(
    [
      String.raw`(?<comment>#[^\n]*)`,
      String.raw`(?<string>(?:\b[rbfuRBFU]{1,2})?(?:'{3}[^]*?(?:'{3}|$)|"{3}[^]*?(?:"{3}|$)|'(?:\\.|[^'\\\n])*'?|"(?:\\.|[^"\\\n])*"?))`,
      String.raw`\b(?:(?<keyword>${keywords.join("|")})|(?<skill>${skills.join("|")})(?=\s*\())\b`,
    ].join("|"),
    "g",
  );

export default {
  props: { program: String, marked: Array, keywords: Array, skills: Array },
  template: `<pre class="source program" tabindex="0" aria-label="Program"><span v-for="(line, at) in lines"
    class="line" :class="{ marked: marked.includes(at + 1) }"><span class="number" aria-hidden="true">{{ at + 1 }}</span
    ><span class="text"><span v-for="part in line" :class="part[0]">{{ part[1] }}</span></span>{{ "\\n" }}</span></pre>`,
  computed: {
    lines() {
      const lines = [[]];
      for (const [look, text] of this.pieces()) {
        text.split("\n").forEach((part, number) => {
          if (number > 0) lines.push([]);
          if (part) lines.at(-1).push([look, part]);
        });
      }
      return lines;
    },
  },
  methods: {
    *pieces() {
      let end = 0;
      const coloured = this.program.length <= MOST_COLOURED; // colouring longer programs would be slow
      for (const found of coloured ? this.program.matchAll(words(this.keywords, this.skills)) : []) {
        yield ["", this.program.slice(end, found.index)];
        yield [Object.keys(found.groups).find((name) => found.groups[name] !== undefined), found[0]];
        end = found.index + found[0].length;
      }
      yield ["", this.program.slice(end)];
    },
  },
};
