"use strict";
// Sorts tables by column, filters groups of failures, and unfolds tables for printing.
for (const table of document.querySelectorAll("table")) {
  const body = table.tBodies[0];
  const value = (row, at) => {
    const cell = row.cells[at];
    return cell.dataset.v === undefined ? cell.textContent : Number(cell.dataset.v);
  };
  const order = (a, b) => typeof a === "number" ? a - b : a.localeCompare(b, "en", {numeric: true});
  [...table.tHead.rows[0].cells].forEach((head, at) => {
    const button = document.createElement("button");
    button.type = "button";
    button.textContent = head.textContent;
    head.replaceChildren(button);
    button.addEventListener("click", () => {
      const up = head.getAttribute("aria-sort") ? head.getAttribute("aria-sort") !== "ascending" : head.classList.contains("text");
      for (const other of table.tHead.rows[0].cells) other.removeAttribute("aria-sort");
      head.setAttribute("aria-sort", up ? "ascending" : "descending");
      const rows = [...body.rows].map((row) => [value(row, at), row]);
      // Cells without a number come last in both directions.
      rows.sort(([a], [b]) => typeof a === typeof b ? (up ? 1 : -1) * order(a, b) : typeof a === "number" ? -1 : 1);
      body.append(...rows.map((row) => row[1]));
    });
  });
}
for (const list of document.querySelectorAll(".groups")) {
  const items = [...list.querySelectorAll(".group")];
  const controls = document.createElement("div");
  controls.className = "filters";
  controls.setAttribute("role", "search");
  const summary = document.createElement("output");
  const fields = ["model", "task", "kind"].map((name) => {
    const field = document.createElement("select");
    field.append(new Option("all", ""));
    for (const one of [...new Set(items.map((item) => item.dataset[name]))].sort()) field.append(new Option(one, one));
    return [name, field];
  });
  const search = document.createElement("input");
  search.type = "search";
  for (const [name, field] of [...fields, ["text in program or reason", search]]) {
    const label = document.createElement("label");
    label.append(name, field);
    controls.append(label);
    field.addEventListener("input", filter);
  }
  controls.append(summary);
  list.before(controls);
  function filter() {
    const words = search.value.toLowerCase();
    let shown = 0, completions = 0;
    for (const item of items) {
      const fits = fields.every(([name, field]) => !field.value || item.dataset[name] === field.value)
        && (!words || item.textContent.toLowerCase().includes(words));
      item.hidden = !fits;
      shown += fits;
      completions += fits ? Number(item.dataset.size) : 0;
    }
    summary.textContent = `${shown} of ${items.length} groups shown, ${completions} completion${completions === 1 ? "" : "s"}`;
  }
  filter();
}
addEventListener("beforeprint", () => {
  for (const one of document.querySelectorAll("details.sheet:not([open])")) {
    one.open = true;
    one.dataset.printed = "";
  }
});
addEventListener("afterprint", () => {
  for (const one of document.querySelectorAll("details[data-printed]")) {
    one.open = false;
    delete one.dataset.printed;
  }
});
