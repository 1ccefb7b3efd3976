#!/usr/bin/env node
// A robot of its own behind the provider protocol, in JavaScript: it drives over an empty floor. Node and nothing else.
//
// It was written from docs/how-to/write-a-provider.md. Everything that keeps it safe is here and not in the harness: it
// stops by itself without keepalives, reports `cancelled` only at a standstill, and refuses old fencing tokens.
//
//   node docs/examples/robot.mjs --port 8765 --token SECRET --name robot-1
//   regen provider check http://127.0.0.1:8765 --token SECRET --file docs/examples/drive.yaml --allow-motion
import { timingSafeEqual } from "node:crypto";
import { createServer } from "node:http";
import { parseArgs } from "node:util";

const PERIOD_S = 0.05; // the control loop
const KEEPALIVE_S = 1.5; // without one for so long it brakes: it must stand within 2 s
const BRAKE_MPS2 = 1.5, TURN_RADPS = 1.2;
const KEPT_SAMPLES = 20000;
const TURN = 2 * Math.PI;

const { values: given } = parseArgs({
    options: {
        port: { type: "string", default: "0" },
        token: { type: "string" },
        name: { type: "string", default: "robot-1" },
        "map-version": { type: "string", default: "site-1" },
        lockstep: { type: "boolean", default: false }, // time passes only on request: for quick tests
    },
});

const CARD = {
    provider_id: "driver", version: "1.0", capability: "navigate", embodiments: ["wheels"],
    parameters: [
        { name: "route", type: "points", unit: "m" },
        { name: "target", type: "point", unit: "m" },
        { name: "frame", type: "frame" },
        { name: "tolerance_m", type: "number", unit: "m", minimum: 0.05, maximum: 2.0 },
        { name: "speed_cap_mps", type: "number", unit: "m/s", minimum: 0.05, maximum: 0.8 },
    ],
    preconditions: ["localised"], side_effects: ["moves the robot"], latency: { base_s: 2.0, per_metre_s: 2.5 },
    resources: ["mobile_base"], cancel: { acknowledged: true, within_s: 2.0 }, risk: "medium",
    failure_words: ["timeout"], evidence: ["pose", "odometry", "battery"],
    estimates: { success: 0.9, risk: 0.1, uncertainty: 0.1, cost: 1.0 }, moves: true, sources: ["odometry"],
    reattach: "by_request", resumable: true, software: "docs/examples/robot.mjs", protocol: "1.1",
};

let lockstep = given.lockstep ? Date.now() / 1000 : null;
const clock = () => lockstep ?? Date.now() / 1000;

/** An answer that is not 200: what happened, and what can be done about it. */
class Refusal extends Error {
    constructor(status, code, what, advice) {
        super(what);
        this.status = status;
        this.problem = { code, what, where: "robot", do: advice };
    }
}
const refuse = (what, advice = "send what the card declares") => new Refusal(409, "provider_failed", what, advice);
const number = value => typeof value === "number" && Number.isFinite(value);
const point = value => Array.isArray(value) && value.length === 2 && value.every(number);
const distance = ([ax, ay], [bx, by]) => Math.hypot(bx - ax, by - ay);
const clamp = (value, bound) => Math.max(-bound, Math.min(bound, value));
const wrapped = angle => angle - TURN * Math.round(angle / TURN);
const noise = sigma => sigma * Math.sqrt(-2 * Math.log(1 - Math.random())) * Math.cos(TURN * Math.random());

/** Equal values in the same form: keys in order. */
const canonical = value => {
    if (Array.isArray(value)) return `[${value.map(canonical)}]`;
    if (value === null || typeof value !== "object") return JSON.stringify(value);
    return `{${Object.keys(value).sort().map(key => `${JSON.stringify(key)}:${canonical(value[key])}`)}}`;
};

/** Two wheels on an empty floor. A real robot reads its localiser and its wheel encoders here, each by itself. */
const body = {
    pose: [0, 0, 0], // where it truly is: nobody is told
    odometry: [0, 0, 0], // what the wheels add up to: it drifts
    v: 0, w: 0, samples: [], seq: 0,

    step(dt, v, w) {
        this.v += clamp(v - this.v, BRAKE_MPS2 * dt);
        this.w = this.v > 0 || v > 0 || w ? w : 0;
        for (const [track, drift] of [[this.pose, 1], [this.odometry, 1.003]]) {
            track[2] += this.w * dt;
            track[0] += this.v * dt * drift * Math.cos(track[2]);
            track[1] += this.v * dt * drift * Math.sin(track[2]);
        }
    },
    sense(now) {
        const [x, y, yaw] = this.pose;
        this.keep(now, "pose", "localiser", {
            frame: "map", map_version: given["map-version"], confidence: 0.95,
            x_m: x + noise(0.01), y_m: y + noise(0.01), yaw_rad: yaw + noise(0.005),
        });
        const [ox, oy, oyaw] = this.odometry;
        this.keep(now, "odometry", "odometry", {
            frame: "odom", x_m: ox, y_m: oy, yaw_rad: oyaw, v_mps: this.v, w_radps: this.w,
        });
        if (this.seq % 40 < 2) this.keep(now, "battery", "battery", { charge: 0.8 });
    },
    keep(at_s, kind, source, values) {
        this.samples.push({ kind, seq: ++this.seq, at_s, source, ...values });
        if (this.samples.length > KEPT_SAMPLES) this.samples.splice(0, this.samples.length - KEPT_SAMPLES);
    },
};

const runs = new Map(); // request id -> the execution
const journal = [];
let active = null, newestToken = 0;

/** One turn of the control loop: drive, brake, end. */
function tick(dt) {
    const now = clock(), run = active;
    const [v, w] = run ? steer(run, now) : [0, 0];
    body.step(dt, v, w);
    body.sense(now);
    if (run) conclude(run, now);
}

function steer(run, now) {
    if (run.ending || now - run.heard > KEEPALIVE_S) {
        run.held = !run.ending;
        return [0, 0];
    }
    const here = body.pose, points = run.points;
    while (points.length > 1 && distance(points[0], here) < 0.25) points.shift();
    const left = distance(points[0], here), last = points.length === 1;
    if (last && left < 0.05) {
        run.ending = ["succeeded", ""];
        return [0, 0];
    }
    const error = wrapped(Math.atan2(points[0][1] - here[1], points[0][0] - here[0]) - here[2]);
    const slow = last ? Math.sqrt(2 * 0.5 * left) : Infinity;
    return [Math.abs(error) > 0.6 ? 0 : Math.min(run.cap, slow), clamp(3 * error, TURN_RADPS)];
}

/** Nothing is reported as over while the body still moves. */
function conclude(run, now) {
    if (!run.ending && now >= run.request.deadline_s) run.ending = ["failed", "timeout"];
    if (!run.ending || body.v !== 0 || body.w !== 0) return;
    run.restSince ??= now;
    if (now - run.restSince < 0.2) return;
    [run.status, run.failure] = run.ending;
    run.ended = now;
    run.final = reportOf(run, now);
    active = null;
}

function start(request) {
    const { identity, parameters } = request, key = identity.request_id, known = runs.get(key);
    const fixed = canonical([identity, request.capability, parameters, request.blobs ?? []]);
    if (known) {
        if (known.fixed !== fixed) throw refuse("The request id came with other contents", "send a new request");
        return reportOf(known, clock());
    }
    check(request);
    const token = request.fencing.mobile_base;
    if (token < newestToken) throw new Refusal(409, "fencing_refused", "A newer token was seen", "ask for the lease again");
    if (active) throw refuse("It follows another route", "stop that first");
    newestToken = token;
    const now = clock();
    const run = {
        request, fixed, handle: `drive-${runs.size}`, heard: now, held: false, ending: null, restSince: null, ended: null,
        points: [...parameters.route, parameters.target], cap: parameters.speed_cap_mps, target: parameters.target,
        share: 0, status: "running", failure: "", final: null,
    };
    run.whole = Math.max(0.1, remaining(run));
    const { request_id, mission_id, node_id, attempt, provider_id } = identity;
    journal.push({ request_id, mission_id, node_id, attempt, provider_id, at_s: now, moves: true }); // a real robot: to disk
    runs.set(key, run);
    active = run;
    return reportOf(run, now);
}

/** Only what the card declares is taken: the right provider, every parameter, its type and its bounds. */
function check({ identity, capability, parameters, fencing }) {
    if (identity.provider_id !== CARD.provider_id || capability !== CARD.capability)
        throw refuse("The request is for somebody else");
    const names = CARD.parameters.map(one => one.name).sort();
    if (canonical(Object.keys(parameters).sort()) !== canonical(names))
        throw refuse("A parameter is missing or unknown");
    const fits = {
        number: (value, one) => number(value) && value >= one.minimum && value <= one.maximum,
        frame: value => value === "map",
        point,
        points: value => Array.isArray(value) && value.every(point),
    };
    for (const one of CARD.parameters)
        if (!fits[one.type](parameters[one.name], one)) throw refuse(`${one.name} is ${parameters[one.name]}`);
    if (!number(fencing.mobile_base)) throw refuse("No lease on mobile_base", "send its fencing token");
}

function remaining(run) {
    const points = [body.pose, ...run.points];
    return points.slice(1).reduce((sum, one, index) => sum + distance(points[index], one), 0);
}

/** How it stands now. What has ended stays as it ended, to the byte. */
function reportOf(run, now) {
    if (run.final) return run.final;
    const done = run.ended !== null;
    run.share = run.status === "succeeded" ? 1 : Math.max(run.share, Math.min(1, 1 - remaining(run) / run.whole));
    let { status, failure } = run;
    if (!done && run.ending?.[0] === "cancelled") status = "stopping";
    else if (!done && run.held) [status, failure] = ["blocked", "keepalive_lost"];
    const declared = done ? { distance_m: distance(body.pose, run.target) } : {};
    return {
        handle: run.handle, identity: run.request.identity, status, at_s: done ? run.ended : now, failure,
        progress: { share: run.share, remaining_m: remaining(run) }, message: done ? `It ended ${status}.` : "", declared,
        proposed_facts: status === "succeeded" ? proposals(run, declared) : [],
    };
}

/** Of what the request is for, what the robot believes to be true now: that it arrived, and stands. */
function proposals(run, declared) {
    const own = {
        arrival: { target_m: run.target, frame: "map", ...declared },
        static_body: {},
    };
    return (run.request.intended ?? [])
        .map(({ effect }) => effect.predicate)
        .filter(name => Object.hasOwn(own, name))
        .map(name => ({ name, arguments: own[name] }));
}

function act(handle, verb) {
    const run = [...runs.values()].find(one => one.handle === handle), now = clock();
    if (!run) throw new Refusal(404, "unknown_name", `No execution has the handle ${handle}`, "find it by its request id");
    if (verb === "stop" && run.ended === null) run.ending ??= ["cancelled", ""];
    if (verb === "keepalive" && !run.held) run.heard = now;
    if (verb === "resume" && run.ended === null) [run.heard, run.held] = [now, false];
    return verb === "keepalive" ? { handle } : reportOf(run, now);
}

function find(key) {
    if (!runs.has(key)) throw new Refusal(404, "unknown_name", `Request ${key} never came here`, "send it once");
    return reportOf(runs.get(key), clock());
}

function status() {
    return {
        robot_id: given.name, at_s: clock(), posture: active ? "moving" : "standing", armed: active !== null,
        hardware_stop: false, charge: 0.8, localised: true, map_version: given["map-version"], pose_age_s: PERIOD_S,
    };
}

function observations(after, limit) {
    const samples = body.samples.filter(one => one.seq > after).slice(0, limit);
    return { samples, next_seq: samples.at(-1)?.seq ?? after, at_s: clock() };
}

/** Lockstep: the control loop, as far as it is asked for. */
function advance(until) {
    for (let left = until - lockstep; left > 1e-6; left = until - lockstep) {
        const step = Math.min(PERIOD_S, left);
        lockstep += step;
        tick(step);
    }
    return { at_s: lockstep };
}

/** The whole protocol, one line for each operation; `clock` and `simulation` are for lockstep. */
function answer(method, url, content) {
    const [first, second, third, ...rest] = url.pathname.split("/").filter(Boolean).map(decodeURIComponent);
    const whole = (name, otherwise) => Number.parseInt(url.searchParams.get(name) ?? otherwise, 10);
    const path = `${method} ${first}`;
    if (path === "GET robot" && !second) return status();
    if (path === "GET clock") return { at_s: clock(), speed: lockstep === null ? 1 : 0, monotonic_s: performance.now() / 1000 };
    if (path === "POST simulation" && second === "advance" && lockstep !== null) return advance(content.until_s);
    if (path === "GET providers" && !second) return [CARD];
    if (path === "POST providers" && second === CARD.provider_id && third === "invocations") return start(content);
    if (path === "GET invocations" && second && !third) return act(second, "report");
    if (path === "GET requests" && second) return find(second);
    if (path === "POST invocations" && ["keepalive", "resume", "stop"].includes(third) && !rest.length) return act(second, third);
    if (path === "GET observations") return observations(whole("after", 0), whole("limit", 5000));
    if (path === "GET starts") return journal;
    if (path === "GET blobs") throw new Refusal(404, "blob_damaged", "There are no bytes of that digest", "ask for named ones");
    throw new Refusal(404, "unknown_name", `There is no ${method} ${url.pathname}`, "read the OpenAPI document");
}

function authorised(header) {
    const expected = Buffer.from(`Bearer ${given.token}`), sent = Buffer.from(header ?? "");
    return expected.length === sent.length && timingSafeEqual(expected, sent);
}

async function serve(request, response) {
    let code = 200, content;
    try {
        const parts = [];
        for await (const part of request) parts.push(part);
        if (!authorised(request.headers.authorization))
            throw new Refusal(401, "unauthorised", "The token is missing or wrong", "send it as a bearer token");
        const text = Buffer.concat(parts).toString("utf8");
        content = answer(request.method, new URL(request.url, "http://robot"), text ? JSON.parse(text) : null);
    } catch (error) {
        const invalid = { code: "invalid_body", what: `The request cannot be read: ${error.message}`, where: "robot", do: "" };
        [code, content] = error instanceof Refusal ? [error.status, error.problem] : [422, invalid];
    }
    const bytes = Buffer.from(JSON.stringify(content));
    response.writeHead(code, { "Content-Type": "application/json", "Content-Length": bytes.length });
    response.end(bytes);
}

if (!given.token) {
    console.error("--token is missing");
    process.exit(2);
}
if (lockstep === null) {
    let before = clock();
    setInterval(() => {
        const now = clock();
        tick(Math.min(now - before, 0.2));
        before = now;
    }, PERIOD_S * 1000);
}
const server = createServer(serve);
server.listen(Number(given.port), "127.0.0.1", () => console.log(`http://127.0.0.1:${server.address().port}`));
