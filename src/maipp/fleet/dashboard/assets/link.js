// The line to the server: what is known, kept up to date; says whether it is there, and comes back by itself.
// A saved page has no server: what is known is in it.
const PATIENCE = 12000; // ms without a word after which the line counts as dead; the server says something every 5 s
const AGAIN = 1500; // ms before another try
const KEEP = 8000; // ms after which a belief is asked for again, so that the server goes on working it out
const SOON = 400; // ms, where a newer one has been announced

export class Link {
  constructor(changed) {
    this.changed = changed; // called with what is new: names of parts, "rows", "field", "link"
    this.parts = {};
    this.rows = [];
    this.instance = "";
    this.who = ""; // whose belief is shown: a robot's name, "" for all together
    this.field = null;
    this.state = "connecting";
    this.since = this.told = Date.now(); // of the state, and of the last news
    this.refused = false;
    this.asking = false;
    this.asked = 0;
    const saved = document.getElementById("saved");
    this.saved = saved && JSON.parse(saved.textContent);
    setInterval(() => this.look(), 200);
  }

  open() {
    if (this.saved) return this.take(this.saved.news);
    this.source?.close();
    this.heard = Date.now();
    const source = (this.source = new EventSource("/events"));
    source.onmessage = (event) => {
      if (source === this.source) this.take(JSON.parse(event.data));
    };
    source.addEventListener("here", () => this.there());
    source.onerror = () => {
      if (source !== this.source) return;
      this.away();
      if (source.readyState === EventSource.CLOSED) this.later();
    };
  }

  later() {
    this.source?.close();
    this.source = null;
    clearTimeout(this.timer);
    this.timer = setTimeout(() => this.open(), AGAIN);
    // Whether it is the token that is wrong only an ordinary question tells.
    fetch("/field?robot=", { cache: "no-store" })
      .then((answer) => this.say(answer.status === 401))
      .catch(() => this.say(false));
  }

  say(refused) {
    if (refused === this.refused) return;
    this.refused = refused;
    this.changed(new Set(["link"]));
  }

  there() {
    this.heard = Date.now();
    const state = this.saved ? "saved" : "live";
    if (this.state === state) return;
    this.state = state;
    this.since = Date.now();
    this.refused = false;
    this.changed(new Set(["link"]));
  }

  away() {
    if (this.state === "away") return;
    this.state = "away";
    this.since = Date.now();
    this.changed(new Set(["link"]));
  }

  take(news) {
    const fresh = new Set(Object.keys(news.parts));
    if (news.instance !== this.instance) {
      // Another server: nothing of what was known before counts.
      this.instance = news.instance;
      this.parts = {};
      this.rows = [];
      this.field = null;
      fresh.add("all");
    }
    if (news.from === 0) this.rows = [];
    if (news.from !== this.rows.length) return this.open();
    if (news.rows.length || news.from === 0) fresh.add("rows");
    this.rows.push(...news.rows);
    Object.assign(this.parts, news.parts);
    this.told = Date.now();
    this.there();
    this.changed(fresh);
  }

  choose(who) {
    this.who = who;
    this.field = null;
    this.asked = 0;
    this.look();
  }

  look() {
    if (this.saved) return this.recall();
    if (this.source && Date.now() - this.heard > PATIENCE) {
      this.away();
      this.open();
    }
    const mark = this.parts.marks?.[this.who];
    if (this.state !== "live" || mark === undefined || this.asking) return;
    if (Date.now() - this.asked > (mark === this.field?.mark ? KEEP : SOON)) this.ask();
  }

  recall() {
    const told = this.saved.fields[this.who];
    if (this.state !== "saved" || this.field || !told) return;
    this.field = unpacked(told);
    this.changed(new Set(["field"]));
  }

  async ask() {
    const { who, instance, field } = this;
    this.asking = true;
    this.asked = Date.now();
    try {
      const mark = field ? `&mark=${encodeURIComponent(field.mark)}` : "";
      const answer = await fetch(`/field?robot=${encodeURIComponent(who)}${mark}`, { cache: "no-store" });
      if (answer.status === 200 && who === this.who && instance === this.instance) {
        this.field = unpacked(await answer.json());
        this.changed(new Set(["field"]));
      }
    } catch {
      // The line to the server says that it is away.
    } finally {
      this.asking = false;
    }
  }
}

function bytes(text) {
  return Uint8Array.from(atob(text), (character) => character.charCodeAt(0));
}

function numbers({ base, step, numbers: text }) {
  const whole = new Uint16Array(bytes(text).buffer);
  return Float64Array.from(whole, (number) => (number === 65535 ? NaN : base + step * number));
}

// The maps of a belief: numbers row by row going north, and which points are in the area and in no zone.
function unpacked(told) {
  const bits = bytes(told.inside);
  const inside = Uint8Array.from({ length: told.side ** 2 }, (_, i) => (bits[i >> 3] >> (i & 7)) & 1);
  return {
    ...told, inside, mean: numbers(told.mean), std: numbers(told.std), surplus: numbers(told.surplus),
  };
}
