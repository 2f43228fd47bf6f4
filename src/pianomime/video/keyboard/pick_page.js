// Lets a person click named points in the picture, and sends them to the server of this page.
const frame = document.getElementById("frame"), message = document.getElementById("message");
const list = document.getElementById("names");
const names = JSON.parse(frame.dataset.names);
const width = Number(frame.dataset.width), height = Number(frame.dataset.height);
const points = {};
let now = 0;

function show() {
  list.replaceChildren(...names.map((name, number) => {
    const item = document.createElement("li");
    item.className = number === now ? "now" : number < now ? "done" : "";
    item.textContent = name + (points[name] ? ` (${points[name].map(Math.round)})` : "");
    return item;
  }));
  frame.querySelectorAll("span").forEach(mark => mark.remove());
  for (const name in points) {
    const mark = document.createElement("span");
    mark.style.left = 100 * points[name][0] / width + "%";
    mark.style.top = 100 * points[name][1] / height + "%";
    mark.title = name;
    frame.append(mark);
  }
}

frame.onclick = event => {
  if (now >= names.length) return;
  const box = frame.getBoundingClientRect();
  points[names[now]] = [(event.clientX - box.left) / box.width * width,
                        (event.clientY - box.top) / box.height * height];
  now++;
  show();
};
document.getElementById("skip").onclick = () => {
  now = Math.min(now + 1, names.length);
  show();
};
document.getElementById("undo").onclick = () => {
  now = Math.max(now - 1, 0);
  delete points[names[now]];
  show();
};
document.getElementById("save").onclick = async () => {
  try {
    const answer = await fetch("points", {
      method: "POST",
      headers: {"Content-Type": "application/json"},
      body: JSON.stringify({points}),
    });
    message.textContent = await answer.text();
  } catch {
    message.textContent = "The program that serves this page has ended.";
  }
};
show();
