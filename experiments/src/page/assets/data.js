// Reading what the page holds: blocks of base 64, compressed as zlib does, and in them JSON or columns of integers.
// `columns.rs`, `rows.rs`, `map.rs`, `series.rs` and `details.rs` write them and say what they are.

/** The bytes of a block of the page. */
async function bytesOf(name) {
  const text = document.getElementById(`data-${name}`).textContent;
  const letters = atob(text);
  const packed = new Uint8Array(letters.length);
  for (let i = 0; i < letters.length; i++) packed[i] = letters.charCodeAt(i);
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

async function jsonOf(name) {
  return JSON.parse(new TextDecoder().decode(await bytesOf(name)));
}

/** Calls `each` with every number of a column and its place. */
function eachNumber(bytes, from, length, each) {
  let at = from;
  const end = from + length;
  for (let row = 0; at < end; row++) {
    let byte = bytes[at++];
    let number = byte & 0x7f;
    // Beyond 28 bits shifts of integers would overflow.
    for (let scale = 128; byte & 0x80; scale *= 128) {
      byte = bytes[at++];
      number += (byte & 0x7f) * scale;
    }
    each(number, row);
  }
}

const signed = (number) => (number % 2 ? -(number + 1) / 2 : number / 2);

/** That a row has no cause; that it has one which is not on the page. */
const NO_CAUSE = -1;
const UNKNOWN_CAUSE = -2;

/**
 * The rows of a log, in order of time. `at` and `sent` are in nanoseconds since the start, `cause` is a row,
 * `detail` the number of the row in the log, by which what it says is found.
 */
function readRows(bytes, told) {
  const n = told.rows;
  const rows = {
    n,
    flow: new Uint32Array(n),
    at: new Float64Array(n),
    sent: new Float64Array(n),
    cause: new Int32Array(n),
    ordinal: new Float64Array(n),
    copy: new Uint16Array(n),
    differs: new Uint8Array(n),
    detail: null,
    longest: 0,
  };
  const next = [];
  let from = 0;
  let before = 0;
  let sorted = true;
  const readers = [
    (number, row) => { rows.flow[row] = number; },
    (number, row) => {
      const since = signed(number);
      if (since < 0) sorted = false;
      before += since;
      rows.at[row] = before * told.unit_ns;
    },
    (number, row) => {
      rows.sent[row] = rows.at[row] - number * told.unit_ns;
      rows.longest = Math.max(rows.longest, number * told.unit_ns);
    },
    (number, row) => { rows.cause[row] = number < 2 ? -1 - number : row - number + 1; },
    (number, row) => {
      const family = told.flows[rows.flow[row]][6];
      const ordinal = (next[family] ?? 0) + signed(number);
      rows.ordinal[row] = ordinal;
      next[family] = ordinal + 1;
    },
    (number, row) => { rows.copy[row] = number; },
    (number, row) => { rows.differs[row] = number; },
  ];
  told.columns.forEach((length, column) => {
    eachNumber(bytes, from, length, readers[column]);
    from += length;
  });
  return sorted ? rows : inOrder(rows);
}

/** The same rows by time: logs of other programs may be in another order. Such rows have no causes. */
function inOrder(rows) {
  const order = Uint32Array.from({ length: rows.n }, (_, row) => row);
  order.sort((a, b) => rows.at[a] - rows.at[b] || a - b);
  const by = (column) => column.map((_, row) => column[order[row]]);
  return {
    ...rows, flow: by(rows.flow), at: by(rows.at), sent: by(rows.sent), ordinal: by(rows.ordinal),
    copy: by(rows.copy), differs: by(rows.differs), detail: order,
  };
}

/** The first row at or after a time. */
function rowFrom(rows, time) {
  let low = 0;
  let high = rows.n;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (rows.at[middle] < time) low = middle + 1;
    else high = middle;
  }
  return low;
}

/** The first row after a time. */
function rowAfter(rows, time) {
  let row = rowFrom(rows, time);
  while (row < rows.n && rows.at[row] <= time) row += 1;
  return row;
}

/** What a flow is called by: class, sender, receiver, link, kind, reason. */
function readFlow(told, flow) {
  const [cls, sender, receiver, link, kind, reason, family] = flow;
  const name = (number) => told.names[number];
  return {
    cls: name(cls), sender: name(sender), receiver: name(receiver), link: name(link), kind: name(kind),
    reason: name(reason), family, senderName: sender, receiverName: receiver,
  };
}

/** One log of the page. */
class Side {
  constructor(letter, head) {
    this.letter = letter;
    this.head = head;
    this.told = head.told;
    this.until = Math.max(1, head.told.until_ns);
    this.flows = head.told.flows.map((flow) => readFlow(head.told, flow));
    this.rows = null;
    this.map = null;
    this.series = null;
    this.details = null;
  }

  async read() {
    const { letter } = this;
    this.rows = readRows(await bytesOf(`rows-${letter}`), this.told);
    [this.map, this.series] = await Promise.all([jsonOf(`map-${letter}`), jsonOf(`series-${letter}`)]);
  }

  flow(row) {
    return this.flows[this.rows.flow[row]];
  }

  /** What a row says, and how its link carried it; none if the page does not have it. */
  async detail(row) {
    this.details ??= await bytesOf(`details-${this.letter}`);
    const at = this.rows.detail ? this.rows.detail[row] : row;
    if (at >= this.told.details) return null;
    const ends = new DataView(this.details.buffer, 0, 4 * this.told.details);
    const from = at ? ends.getUint32(4 * (at - 1), true) : 0;
    const first = 4 * this.told.details;
    const text = this.details.subarray(first + from, first + ends.getUint32(4 * at, true));
    const [says, carried] = new TextDecoder().decode(text).split("\n");
    return { says, carried: carried ?? "" };
  }

  /** What a message is called by `fork`, `diff` and scenarios. */
  id(row) {
    const { sender, receiver, kind } = this.flow(row);
    const copy = this.rows.copy[row];
    return `${sender},${receiver},${kind},${this.rows.ordinal[row]}${copy ? `+${copy}` : ""}`;
  }

  /** The row of a message that `diff` names, nearest to its time; -1 if it is not on the page. */
  find({ sender, receiver, ordinal, kind, time }) {
    let best = -1;
    const is = this.flows.map((flow) => flow.sender === sender && flow.receiver === receiver
      && (!kind || flow.kind === kind));
    for (let row = 0; row < this.rows.n; row++) {
      if (!is[this.rows.flow[row]] || (ordinal !== null && this.rows.ordinal[row] !== ordinal)) continue;
      const distance = Math.abs(this.rows.at[row] - time);
      if (best < 0 || distance < Math.abs(this.rows.at[best] - time)) best = row;
    }
    return best;
  }

  /** What led to a row, nearest first; of a timer that set itself again and again one, with how often. */
  chain(row) {
    const chain = [];
    let cause = this.rows.cause[row];
    while (cause >= 0) {
      const last = chain.at(-1);
      const flow = this.rows.flow[cause];
      if (last && this.rows.flow[last.row] === flow && this.flows[flow].cls === "timer") {
        last.repeats += 1;
        last.since = cause;
      } else {
        chain.push({ row: cause, repeats: 0, since: cause });
      }
      cause = this.rows.cause[cause];
    }
    return { chain, unknown: cause === UNKNOWN_CAUSE };
  }

  /** The rows that a row caused, the first so many of them, and how many there are. */
  effects(row, most) {
    const effects = [];
    let count = 0;
    for (let other = row + 1; other < this.rows.n; other++) {
      if (this.rows.cause[other] !== row) continue;
      if (effects.length < most) effects.push(other);
      count += 1;
    }
    return { effects, count };
  }
}
