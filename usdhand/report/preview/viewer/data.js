// The arrays of the page: inflated, summed up and scaled again. The other end is pack.py.

/** An array of `rows` x `columns` numbers, row after row in `values`. */
class Table {
  constructor(rows, columns, values) {
    this.rows = rows;
    this.columns = columns;
    this.values = values;
  }

  /** Writes the row at a fractional number into `out`, blended from its neighbours. */
  at(row, out) {
    const last = this.rows - 1;
    const place = Math.min(Math.max(row, 0), last);
    const low = Math.floor(place);
    const share = place - low;
    const a = low * this.columns;
    const b = Math.min(low + 1, last) * this.columns;
    for (let i = 0; i < this.columns; i++) {
      out[i] = this.values[a + i] + share * (this.values[b + i] - this.values[a + i]);
    }
    return out;
  }
}

const TYPES = { i2: [Uint16Array, Int16Array], u1: [Uint8Array], u2: [Uint16Array], u4: [Uint32Array] };

/** Tables from `{arrays, data}`, in the order of `arrays`. */
export async function unpack({ arrays, data }) {
  const bytes = await inflate(Uint8Array.from(atob(data), (c) => c.charCodeAt(0)));
  let start = 0;
  return arrays.map((entry) => {
    const size = Number(entry.kind[1]);
    const count = entry.rows * entry.columns;
    const table = decoded(entry, bytes.subarray(start, start + count * size), size);
    start += count * size;
    return table;
  });
}

async function inflate(bytes) {
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream('deflate'));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

function decoded({ kind, rows, columns, middle, step }, bytes, size) {
  const [Whole, Signed] = TYPES[kind];
  const count = rows * columns;
  const whole = new Whole(count);
  for (let place = 0; place < size; place++) {
    for (let i = 0; i < count; i++) whole[i] += bytes[place * count + i] * 2 ** (8 * place);
  }
  for (let c = 0; c < columns; c++) {
    for (let i = c * rows + 1; i < (c + 1) * rows; i++) whole[i] += whole[i - 1];
  }
  const source = Signed ? new Signed(whole.buffer) : whole;
  const values = Signed ? new Float32Array(count) : new Whole(count);
  for (let c = 0; c < columns; c++) {
    for (let r = 0; r < rows; r++) {
      const value = source[c * rows + r];
      values[r * columns + c] = Signed ? middle + step * value : value;
    }
  }
  return new Table(rows, columns, values);
}
