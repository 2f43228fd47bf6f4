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
  // Of several numbers, as of an error's percentiles, the middle one counts.
  const number = (text) => {
    const numbers = text.match(/-?\d+(\.\d+)?/g);
    return numbers ? Number(numbers[Math.floor(numbers.length / 2)]) : -Infinity;
  };
  const show = () => {
    const measure = form.elements.measure.value;
    const sought = form.elements.find.value.trim().toLowerCase();
    const value = (card) => card.values[measure];
    cards.sort(
      measure === "song"
        ? (a, b) => value(a).localeCompare(value(b))
        : (a, b) => number(value(b)) - number(value(a)),
    );
    for (const { element, values, text } of cards) {
      element.hidden = !text.includes(sought);
      element.style.display = element.hidden ? "none" : "";
      element.querySelectorAll(".sorted").forEach((part) => part.remove());
      if (measure !== "song") {
        for (const [tag, content] of [["dt", measure], ["dd", values[measure]]]) {
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
  form.addEventListener("input", show);
  form.addEventListener("submit", (event) => event.preventDefault());
})();
