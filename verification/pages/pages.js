"use strict";
(() => {
  const root = document.documentElement;
  const pages = [...document.querySelectorAll(".page")];
  const links = [...document.querySelectorAll("nav a")];
  const cases = [...document.querySelectorAll("details.case")];
  const folded = new Set(cases.filter((c) => c.matches(".met, .informative")));

  function show() {
    const name = decodeURIComponent(location.hash.slice(1));
    const found = (name && document.getElementById(name)) || pages[0];
    const page = found.closest(".page") || pages[0];
    for (const own of pages) own.classList.toggle("seen", own === page);
    for (const link of links) {
      if (link.hash === "#" + page.id) link.setAttribute("aria-current", "page");
      else link.removeAttribute("aria-current");
    }
    for (let own = found.closest("details"); own; own = own.parentElement.closest("details")) own.open = true;
    if (found === page) window.scrollTo(0, 0);
    else found.scrollIntoView();
  }

  const value = (row, k) => {
    const cell = row.cells[k];
    return cell.dataset.sort === undefined ? cell.textContent.trim() : Number(cell.dataset.sort);
  };

  function compare(a, b) {
    if (typeof a === "number" && typeof b === "number") return a - b;
    return String(a).localeCompare(String(b), "en", { numeric: true });
  }

  function sort(head) {
    const table = head.closest("table");
    const k = head.cellIndex;
    const down = head.getAttribute("aria-sort") === "ascending";
    for (const other of head.parentElement.cells) other.removeAttribute("aria-sort");
    head.setAttribute("aria-sort", down ? "descending" : "ascending");
    const body = table.tBodies[0];
    const numeric = head.classList.contains("n");
    const missing = (row) => (numeric ? row.cells[k].dataset.sort === undefined : row.cells[k].textContent === "");
    const rows = [...body.rows].sort((a, b) =>
      missing(a) - missing(b) || (down ? -1 : 1) * compare(value(a, k), value(b, k)));
    body.append(...rows);
  }

  document.addEventListener("click", (event) => {
    const head = event.target.closest("th");
    if (head && event.target.closest("button")) sort(head);
    const picture = event.target.closest(".enlarge");
    if (picture) picture.closest("figure").classList.toggle("large");
  });
  document.getElementById("short").addEventListener("change", (event) =>
    root.classList.toggle("short", event.target.checked));
  let opened = [];
  addEventListener("beforeprint", () => {
    opened = cases.filter((c) => !c.open);
    for (const c of opened) c.open = true;
  });
  addEventListener("afterprint", () => {
    for (const c of opened) c.open = false;
  });
  addEventListener("hashchange", show);

  for (const head of document.querySelectorAll("thead th")) {
    const button = document.createElement("button");
    button.append(...head.childNodes);
    head.append(button);
  }
  for (const c of folded) c.open = false;
  root.classList.add("live");
  show();
  root.dataset.state = "done";
})();
