"use strict";
// Runs the program in its own thread, since a task is cancelled by ending the thread.
let program;
let panic = "";
const PART_BYTES = 1 << 23;
const text = (pointer, length) => new TextDecoder().decode(new Uint8Array(program.memory.buffer, pointer >>> 0, length));
const page = {
  progress: (() => {
    let last = 0, of = -1;
    return (task, done) => {
      // Progress within a task is sent at most every 100 ms, except in the analysis (task 1).
      if (task === of && task !== 1 && Date.now() - last < 100) return;
      [last, of] = [Date.now(), task];
      postMessage({ task, done });
    };
  })(),
  panicked: (pointer, length) => { panic = text(pointer, length); },
};
const load = (file) => {
  const start = program.reserve_file(file.size) >>> 0;
  const reader = new FileReaderSync();
  for (let from = 0; from < file.size; from += PART_BYTES) {
    const part = new Uint8Array(reader.readAsArrayBuffer(file.slice(from, from + PART_BYTES)));
    new Uint8Array(program.memory.buffer, start + from, part.length).set(part);
  }
};
const call = ({ name, request, file }) => {
  if (file) load(file);
  const bytes = new TextEncoder().encode(JSON.stringify(request));
  const start = program.reserve_request(bytes.length) >>> 0;
  new Uint8Array(program.memory.buffer, start, bytes.length).set(bytes);
  const failed = program[name]();
  const answer = text(program.answer_pointer(), program.answer_length());
  return failed ? { error: answer } : { answer, memory: program.memory.buffer.byteLength };
};
let ready;
onmessage = async ({ data }) => {
  if (data instanceof WebAssembly.Module) {
    // The other imports belong to crates that get random numbers from a browser. The program needs no random numbers.
    const unused = () => { throw new Error("not in this page"); };
    const imports = { page };
    for (const { module, name } of WebAssembly.Module.imports(data)) if (module !== "page") (imports[module] ??= {})[name] = unused;
    ready = WebAssembly.instantiate(data, imports).then((instance) => { program = instance.exports; });
    return;
  }
  try {
    await ready;
    postMessage(call(data));
  } catch (error) {
    const what = error.name === "NotReadableError" ? "the file cannot be read" : panic || "the recording needs more memory than a page has";
    postMessage({ error: `${what} (${error.message})`, isBroken: true });
  }
};
