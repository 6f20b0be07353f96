// Shows a table with a shade and a number for each share. Cells link to their completions.
export default {
  props: { prefix: String, label: String, corner: String, groups: Array, rows: Array, chooses: Boolean },
  emits: ["choose"],
  template: `
    <div class="heat" tabindex="0" role="region" :aria-label="label">
      <table>
        <thead>
          <tr v-if="groups.length > 1">
            <td></td>
            <th v-for="group in groups" scope="colgroup" :colspan="group.columns.length" class="group">
              <a v-if="group.href" :href="prefix + group.href" dir="auto">{{ group.name }}</a>
              <span v-else dir="auto">{{ group.name }}</span>
            </th>
          </tr>
          <tr>
            <th scope="col" class="name">{{ corner }}</th>
            <template v-for="group in groups">
              <th v-for="(column, at) in group.columns" scope="col" :class="{ first: at === 0 }" :title="column.title">
                <a v-if="column.href" :href="prefix + column.href" dir="auto">{{ column.name }}</a>
                <span v-else dir="auto">{{ column.name }}</span>
              </th>
            </template>
          </tr>
        </thead>
        <tbody>
          <tr v-for="(row, at) in rows" :key="at">
            <th scope="row" :class="['name', row.look]" dir="auto"><template v-for="piece in pieces(row.name)">{{ piece }}<wbr></template></th>
            <td v-for="cell in row.cells" :class="[cell.shade, row.look]" :colspan="cell.span">
              <a v-if="cell.href" :href="prefix + cell.href" :title="cell.title" :aria-label="cell.title"
                :aria-current="cell.here ? 'true' : null" @click="choose($event, cell)">{{ cell.text }}</a>
              <span v-else>{{ cell.text }}</span>
            </td>
          </tr>
        </tbody>
      </table>
    </div>`,
  methods: {
    pieces: (name) => name.split(/(?<=[a-z:])(?=[A-Z ])/),
    choose(event, cell) {
      if (!this.chooses || event.ctrlKey || event.metaKey || event.shiftKey || event.altKey) return;
      event.preventDefault();
      this.$emit("choose", cell.at);
    },
  },
};
