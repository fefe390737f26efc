"use strict";
for (const table of document.querySelectorAll("table.sortable")) {
  const heads = Array.from(table.tHead.rows[0].cells);
  const body = table.tBodies[0];
  heads.forEach((head, column) => {
    head.querySelector("button").addEventListener("click", () => {
      const falling = head.getAttribute("aria-sort") === "ascending";
      const key = (row) => {
        const text = row.cells[column].dataset.key;
        if (text === "") return null;
        return Number.isNaN(Number(text)) ? text : Number(text);
      };
      const order = (one, other) => {
        const [a, b] = [key(one), key(other)];
        if (a === b) return 0;
        if (a === null || b === null) return a === null ? 1 : -1; // no value: always last
        return (a < b) === falling ? 1 : -1;
      };
      body.append(...Array.from(body.rows).sort(order));
      for (const other of heads) other.setAttribute("aria-sort", "none");
      head.setAttribute("aria-sort", falling ? "descending" : "ascending");
    });
  });
}
