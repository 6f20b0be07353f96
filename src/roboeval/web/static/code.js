// A program, line by line, with its words coloured by what they are; all of it is text.
export default {
  props: { lines: Array, marked: Array },
  template: `<pre class="source program" tabindex="0" aria-label="Program"><span v-for="(line, at) in lines"
    class="line" :class="{ marked: marked.includes(at + 1) }"><span class="number" aria-hidden="true">{{ at + 1 }}</span
    ><span class="text"><span v-for="part in line" :class="part[0]">{{ part[1] }}</span></span>{{ "\\n" }}</span></pre>`,
};
