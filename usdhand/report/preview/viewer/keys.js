// Keys: what they do, and the list of them on the page.

import { element } from 'dom';

const CLICKABLE = 'button, summary, a, input[type=checkbox], input[type=radio]';
const TYPED_INTO = 'select, textarea, input:not([type=range]):not([type=checkbox]):not([type=radio])';

/** Binds `[keys, words, action]` while `enabled()`, and lists them in a table's body. */
export function bindKeys(bindings, list, enabled) {
  const actions = new Map();
  for (const [keys, words, ...all] of bindings) {
    keys.forEach((key, i) => actions.set(key, all[Math.min(i, all.length - 1)]));
    const row = element('tr');
    const cell = element('td');
    keys.forEach((key) => cell.append(element('kbd', {}, NAMES[key] ?? key), ' '));
    row.append(cell, element('td', {}, words));
    list.append(row);
  }
  document.addEventListener('keydown', (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey || !enabled()) return;
    if (event.key === 'Escape') event.target.blur();
    if (event.target.closest(TYPED_INTO)) return;
    if (event.key === ' ' && event.target.closest(CLICKABLE)) return;
    if (event.target.matches('input[type=radio]') && event.key.startsWith('Arrow')) return;
    const key = event.shiftKey && event.key.startsWith('Arrow') ? `Shift+${event.key}` : event.key;
    const action = actions.get(key.length === 1 ? key.toLowerCase() : key);
    if (!action) return;
    event.preventDefault();
    action();
  });
}

const NAMES = {
  ' ': 'space',
  ArrowLeft: '←',
  ArrowRight: '→',
  Escape: 'Esc',
  'Shift+ArrowLeft': 'shift ←',
  'Shift+ArrowRight': 'shift →',
};
