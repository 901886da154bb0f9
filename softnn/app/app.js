// Sends dropped or chosen files one by one; the rest of the pages is Python.
window.softnn = (() => {
  const at = (id) => document.getElementById(id);
  const say = (text) => { const line = at("sending"); if (line) line.textContent = text; };

  function refuse(lines) {
    const box = at("refused");
    if (!box || !lines.length) return;
    box.replaceChildren(...lines.map((text) => {
      const item = document.createElement("li");
      item.textContent = text;
      return item;
    }));
    box.hidden = false;
  }

  // A dropped folder is walked through; its files come with their own names.
  async function inside(entry) {
    if (entry.isFile) return [await new Promise((ok, no) => entry.file(ok, no))];
    const reader = entry.createReader(), found = [];
    for (;;) {
      const some = await new Promise((ok, no) => reader.readEntries(ok, no));
      if (!some.length) break;
      for (const one of some) found.push(...await inside(one));
    }
    return found;
  }

  async function send(files) {
    const zone = at("drop"), refused = [];
    if (!zone || !files.length) return;
    let project = zone.dataset.project;
    at("refused").hidden = true;
    try {
      if (!project) {
        const made = await fetch("/project", { method: "POST" });
        if (!made.ok) throw new Error(await made.text());
        project = await made.text();
      }
      for (const [i, file] of files.entries()) {
        say(`Sending ${i + 1} of ${files.length}: ${file.name}`);
        if (file.size > Number(zone.dataset.most)) {
          refused.push(`${file.name}: over ${zone.dataset.most / 1e6} MB; split it`);
          continue;
        }
        const address = `/project/${project}/files?name=${encodeURIComponent(file.name)}`;
        const answer = await fetch(address, { method: "POST", body: file });
        if (!answer.ok) refused.push(`${file.name}: ${await answer.text()}`);
      }
    } catch (error) {
      refused.push(`The files could not be sent (${error.message}). Is softnn app still running?`);
    }
    say("");
    if (zone.dataset.project) {
      refuse(refused);
      emitEvent("dropped");
    } else if (refused.length < files.length) {
      sessionStorage.setItem("refused", JSON.stringify(refused));
      location.assign(`/project/${project}${zone.dataset.then}`);
    } else {
      refuse(refused);
    }
  }

  function chosen(input) {
    send([...input.files]);
    input.value = "";
  }

  function over(event, on) {
    const zone = at("drop");
    if (!zone || ![...event.dataTransfer.types].includes("Files")) return;
    event.preventDefault();
    zone.classList.toggle("over", on);
  }
  addEventListener("dragover", (event) => over(event, true));
  addEventListener("dragleave", (event) => over(event, false));
  addEventListener("drop", async (event) => {
    over(event, false);
    const entries = [...event.dataTransfer.items].map((x) => x.webkitGetAsEntry?.());
    const plain = [...event.dataTransfer.files];
    if (!plain.length) return;
    const walked = entries.every(Boolean) ? await Promise.all(entries.map(inside)) : [plain];
    send(walked.flat());
  });

  function begin() {
    const before = JSON.parse(sessionStorage.getItem("refused") || "[]");
    sessionStorage.removeItem("refused");
    refuse(before);
  }
  return { chosen, begin };
})();
