// What scripts say, in the reader's language: the page carries the translations of every message asked for here.
const known = JSON.parse(document.body.dataset.translations || "{}");

export function tr(message, fields = {}) {
  return (known[message] || message).replace(/\{(\w+)\}/g, (hole, name) => fields[name] ?? hole);
}
