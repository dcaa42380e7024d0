// Small help with elements.

export function element(tag, attributes = {}, text = '') {
  const made = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) made.setAttribute(name, value);
  made.textContent = text;
  return made;
}

export const find = (id) => document.getElementById(id);

/** A custom property of the page's style: colours follow light and dark. */
export function style(name) {
  return getComputedStyle(document.documentElement).getPropertyValue(name).trim();
}

export function pressed(button, on) {
  button.setAttribute('aria-pressed', String(on));
}
