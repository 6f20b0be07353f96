// Shows a virtual list of completions, whose rows are fetched shortly before they scroll into view.
const PAGE = 200;
const BEYOND = 12;
const LOST = "The server cannot be reached. Is it still running?";

export default {
  props: { source: String, version: Number, base: String, query: String },
  template: `
    <div class="completions">
      <p id="count" class="quiet" role="status">{{ status }}</p>
      <div role="table" :aria-rowcount="total + 1" aria-label="Completions" aria-describedby="count">
        <div role="rowgroup" class="completions-head">
          <div role="row" aria-rowindex="1" class="completion">
            <span role="columnheader">Completion</span><span role="columnheader">Verdict</span>
            <span role="columnheader">Worlds</span><span role="columnheader">First failure</span>
          </div>
        </div>
        <div ref="view" role="rowgroup" class="completions-view" tabindex="0" aria-label="Completions, in order"
          :style="{ height: Math.max(1, Math.min(total, 12)) * tall + 'px' }" @scroll.passive="look">
          <div class="completions-all" role="presentation" :style="{ height: total * tall + 'px' }">
            <div v-for="row in shown" :key="row.at" role="row" class="completion" :aria-rowindex="row.at + 2"
              :style="{ transform: 'translateY(' + row.at * tall + 'px)', height: tall + 'px' }">
              <template v-if="row.one">
                <span role="cell" class="which"><a :href="address(row.one)" dir="auto">{{ name(row.one) }}</a></span>
                <span role="cell" class="verdict-cell"><b :class="lookOf(row.one)" dir="auto">{{ verdict(row.one) }}</b></span>
                <span role="cell" class="worlds"><span role="img" :aria-label="worlds(row.one)" :title="worlds(row.one)">
                  <i v-for="sign in signs(row.one)" :class="sign[0]">{{ sign[1] }}</i></span></span>
                <span role="cell" class="why" dir="auto">{{ row.one.why }}</span>
              </template>
              <span v-else role="cell" class="quiet">…</span>
            </div>
          </div>
        </div>
      </div>
    </div>`,
  data: () => ({ total: 0, status: "", tall: 44, first: 0, last: 0, pages: {} }),
  computed: {
    shown() {
      const rows = [];
      for (let at = this.first; at < Math.min(this.last, this.total); at++) {
        rows.push({ at, one: this.pages[Math.floor(at / PAGE)]?.[at % PAGE] });
      }
      return rows;
    },
  },
  watch: {
    source() {
      this.$refs.view.scrollTop = 0;
      this.pages = {};
      this.refresh();
    },
    version() {
      this.refresh();
    },
  },
  mounted() {
    this.under = new Map();
    this.turn = 0;
    this.measure();
    window.addEventListener("resize", this.measure);
    this.refresh();
  },
  unmounted() {
    window.removeEventListener("resize", this.measure);
  },
  methods: {
    measure() {
      this.tall = parseFloat(getComputedStyle(this.$el).getPropertyValue("--tall")) || 44;
      this.look();
    },
    look() {
      const view = this.$refs.view;
      this.first = Math.max(0, Math.floor(view.scrollTop / this.tall) - BEYOND);
      this.last = Math.ceil((view.scrollTop + Math.max(view.clientHeight, 12 * this.tall)) / this.tall) + BEYOND;
      const [from, to] = [Math.floor(this.first / PAGE) - 1, Math.floor(this.last / PAGE) + 1];
      for (let page = Math.max(0, from); page <= to && (page === 0 || page * PAGE < this.total); page++) {
        if (!this.pages[page] || this.stale?.has(page)) this.fetchPage(page);
      }
    },
    refresh() {
      this.turn++;
      this.under.clear();
      this.stale = new Set(Object.keys(this.pages).map(Number));
      this.look();
    },
    async fetchPage(page) {
      if (this.under.get(page) === this.turn) return;
      const turn = this.turn;
      this.under.set(page, turn);
      try {
        const answer = await fetch(`${this.source}&offset=${page * PAGE}&limit=${PAGE}`);
        const found = await answer.json();
        if (turn !== this.turn) return;
        if (!answer.ok) throw new Error(found.detail);
        this.pages[page] = found.completions;
        this.stale.delete(page);
        this.total = found.total;
        this.status = `${found.total.toLocaleString("en")} completion${found.total === 1 ? "" : "s"}`;
        this.look();
      } catch (error) {
        if (turn === this.turn) this.status = error instanceof TypeError ? LOST : error.message;
      } finally {
        if (this.under.get(page) === turn) this.under.delete(page);
      }
    },
    name: (one) => `${one.task}/${one.prompt}/${one.index}`,
    address(one) {
      return `${this.base}/${encodeURIComponent(one.task.toWellFormed())}/${one.prompt}/${one.index}${this.query}`;
    },
    verdict: (one) => (one.passed === null ? "not judged yet" : one.passed ? "passed" : one.failure.kind),
    lookOf: (one) => (one.passed === null ? "waits" : one.passed ? "good" : "bad"),
    signs: (one) => [...one.worlds].map((sign) => (sign === "+" ? ["good", "✓"] : ["bad", sign === "!" ? "!" : "✗"])),
    worlds(one) {
      const good = [...one.worlds].filter((sign) => sign === "+").length;
      return one.worlds ? `${good} of ${one.worlds.length} worlds satisfied` : "not run in any world yet";
    },
  },
};
