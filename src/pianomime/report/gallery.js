// Sorts the cards of a gallery by any measure, and hides those whose text does not hold what is sought.
"use strict";
(() => {
  const form = document.getElementById("order");
  const grid = document.querySelector(".cards");
  const cards = [...grid.children].map((element) => ({
    element,
    values: JSON.parse(element.dataset.values),
    text: element.textContent.toLowerCase(),
  }));
  const { measure, direction, find } = form.elements;
  // Songs begin with A, and measures with the largest.
  let reversed = false;
  // Of several numbers, as of an error's percentiles, the middle one counts.
  const number = (text) => {
    const numbers = text.match(/-?\d+(\.\d+)?/g);
    return numbers ? Number(numbers[Math.floor(numbers.length / 2)]) : null;
  };
  const compare = (one, other) => {
    const sign = reversed ? -1 : 1;
    const [a, b] = [one.values[measure.value], other.values[measure.value]];
    if (measure.value === "song") return sign * a.localeCompare(b);
    const [x, y] = [number(a), number(b)];
    // What was not measured comes last both ways.
    if (x === null || y === null) return (x === null) - (y === null);
    return sign * (y - x);
  };
  const show = () => {
    const name = measure.value;
    const sought = find.value.trim().toLowerCase();
    const ways = name === "song" ? ["A to Z", "Z to A"] : ["largest first", "smallest first"];
    direction.textContent = ways[Number(reversed)];
    cards.sort(compare);
    for (const { element, values, text } of cards) {
      element.hidden = !text.includes(sought);
      element.querySelectorAll(".sorted").forEach((part) => part.remove());
      if (name !== "song") {
        for (const [tag, content] of [["dt", name], ["dd", values[name]]]) {
          const part = document.createElement(tag);
          part.className = "sorted";
          part.textContent = content;
          element.querySelector("dl").append(part);
        }
      }
      grid.append(element);
    }
  };
  form.hidden = false;
  show();
  measure.addEventListener("input", () => {
    reversed = false;
    show();
  });
  direction.addEventListener("click", () => {
    reversed = !reversed;
    show();
  });
  find.addEventListener("input", show);
  form.addEventListener("submit", (event) => event.preventDefault());
})();
