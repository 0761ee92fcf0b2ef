"use strict";
(() => {
  const table = document.getElementById("all");
  const body = table.tBodies[0];
  const rows = Array.from(body.rows);
  const heads = Array.from(table.tHead.rows[0].cells);
  const controls = Array.from(document.querySelectorAll("[data-filter]"));
  const shown = document.getElementById("shown");
  const compare = new Intl.Collator("en", { numeric: true }).compare;
  const keys = new Map();

  function keysOf(column) {
    if (!keys.has(column)) {
      const numeric = heads[column].dataset.kind === "number";
      keys.set(column, new Map(rows.map((row) => {
        const text = row.cells[column].dataset.v || "";
        return [row, text === "" ? null : numeric ? Number(text) : text];
      })));
    }
    return keys.get(column);
  }

  function sort(column) {
    const descending = heads[column].getAttribute("aria-sort") === "ascending";
    const key = keysOf(column);
    const sign = descending ? -1 : 1;
    const order = rows.slice().sort((a, b) => {
      const x = key.get(a), y = key.get(b);
      if (x === null || y === null) return (x === null) - (y === null);
      return sign * (typeof x === "number" ? x - y : compare(x, y));
    });
    heads.forEach((head, at) => {
      if (at === column) head.setAttribute("aria-sort", descending ? "descending" : "ascending");
      else head.removeAttribute("aria-sort");
    });
    body.append(...order);
  }

  function matches(row, wanted) {
    return wanted.every(([name, value]) => {
      if (name === "text") return row.dataset.text.includes(value);
      if (name === "flags") return row.dataset.flags.split(" ").includes(value);
      return row.dataset[name] === value;
    });
  }

  function filter() {
    const wanted = controls
      .map((one) => [one.dataset.filter, one.type === "checkbox" ? (one.checked ? "yes" : "") : one.value.trim().toLowerCase()])
      .filter(([, value]) => value !== "");
    let count = 0;
    for (const row of rows) {
      const visible = matches(row, wanted);
      if (row.hidden === visible) row.hidden = !visible;
      count += visible;
    }
    shown.textContent = `${count} of ${rows.length} shown`;
  }

  heads.forEach((head, column) => {
    const button = head.querySelector("button");
    if (button) button.addEventListener("click", () => sort(column));
  });
  controls.forEach((one) => one.addEventListener("input", filter));
  document.addEventListener("click", (event) => {
    const link = event.target.closest && event.target.closest('a[href^="#p"]');
    if (link) {
      const row = document.getElementById(link.getAttribute("href").slice(1));
      if (row && row.hidden) {
        controls.forEach((one) => { if (one.type === "checkbox") one.checked = false; else one.value = ""; });
        filter();
      }
    }
  });
  document.documentElement.classList.add("live");
  filter();
})();
