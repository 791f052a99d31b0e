// The live view of `rollwalk-sim --foxglove` and `rollwalk monitor --foxglove`, by Foxglove's own client library.
// STUDIO_ROLLWALK and STUDIO_SIM are the programs.
import assert from "node:assert/strict";
import { mkdtemp } from "node:fs/promises";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { after, before, describe, test } from "node:test";
import published from "@foxglove/schemas/jsonschema.js";
import protocol from "@foxglove/ws-protocol";
import WebSocket from "ws";
import { Program, program, simulator } from "./programs.mjs";
import { WAIT_MS, within } from "./within.mjs";

// CommonJS modules have no named exports here.
const { FoxgloveClient } = protocol;
const TOPICS = ["/tf", "/robot", "/joint_states", "/planned_joint_states", "/forces"];
const SCHEMAS = ["foxglove.FrameTransforms", "foxglove.SceneUpdate", "foxglove.JointStates", "foxglove.JointStates", "foxglove.SceneUpdate"];

/** Asserts that a message has the fields of its JSON schema and no others, of the types that the schema names. */
function conforms(value, schema) {
  if (schema.type === "array") return value.forEach((item) => conforms(item, schema.items));
  if (schema.type !== "object") return assert.equal(typeof value, schema.type === "integer" ? "number" : schema.type);
  for (const name of schema.required ?? []) assert.ok(name in value, `${schema.title} has ${name}`);
  for (const [name, field] of Object.entries(value)) conforms(field, schema.properties[name] ?? assert.fail(`${schema.title} has no ${name}`));
}

/** A client with the messages of all topics, which must conform to the server's schemas and to Foxglove's. */
class Client {
  channels = new Map();
  messages = new Map();

  static async connect(address, subprotocol = "foxglove.sdk.v1") {
    const socket = new WebSocket(address, [subprotocol]);
    const client = new Client();
    const foxglove = new FoxgloveClient({ ws: socket });
    client.close = () => foxglove.close();
    const decoder = new TextDecoder();
    const types = new Map();
    foxglove.on("serverInfo", (info) => (client.info = info));
    foxglove.on("advertise", (channels) => {
      for (const channel of channels) {
        client.channels.set(channel.topic, channel);
        const schema = JSON.parse(channel.schema);
        assert.deepEqual([channel.encoding, channel.schemaEncoding, schema.title], ["json", "jsonschema", channel.schemaName]);
        types.set(foxglove.subscribe(channel.id), [channel.topic, schema]);
      }
    });
    foxglove.on("message", ({ subscriptionId, data }) => {
      const [topic, schema] = types.get(subscriptionId);
      const all = client.messages.get(topic) ?? [];
      const message = JSON.parse(decoder.decode(data));
      conforms(message, schema);
      conforms(message, published[schema.title.replace("foxglove.", "")]);
      client.messages.set(topic, [...all, message]);
    });
    const open = new Promise((resolve, reject) => {
      foxglove.on("open", resolve);
      foxglove.on("error", reject);
    });
    await within(`a connection to ${address}`, open);
    return client;
  }

  /** Waits for some messages of a topic. */
  async some(topic, count) {
    for (const end = Date.now() + WAIT_MS; Date.now() < end; ) {
      const all = this.messages.get(topic) ?? [];
      if (all.length >= count) return all;
      await new Promise((resolve) => setTimeout(resolve, 50));
    }
    throw new Error(`${topic}: ${this.messages.get(topic)?.length ?? 0} of ${count} messages came`);
  }
}

describe("robots in Foxglove", { skip: program && simulator ? false : "STUDIO_ROLLWALK and STUDIO_SIM name no programs" }, () => {
  let bus, robot, address;
  before(async () => {
    bus = `sim:${join(await mkdtemp(join(tmpdir(), "live-")), "robot.sock")}`;
    robot = new Program(simulator, ["robots/agilebot.toml", "--bus", bus, "--foxglove", "0"]);
    address = await robot.said(/ws:\S+/);
    await robot.said(/Ctrl-C/);
  });
  after(() => robot?.kill());

  test("a simulated robot has frames, solids, joints and forces", async () => {
    const client = await Client.connect(address);
    const frames = await client.some("/tf", 20);
    assert.deepEqual(TOPICS.map((topic) => client.channels.get(topic)?.schemaName), SCHEMAS);
    assert.equal(client.info.name, "agilebot");
    // No client can command the robot here.
    assert.deepEqual(client.info.capabilities, []);
    const names = new Set(frames.flatMap((message) => message.transforms.map((of) => of.child_frame_id)));
    assert.ok(names.has("body") && names.has("planned/body"), [...names].join());
    const solids = await client.some("/robot", 2);
    for (const entity of solids.flatMap((message) => message.entities)) assert.ok(names.has(entity.frame_id), entity.frame_id);
    const body = frames.at(-1).transforms.find((of) => of.parent_frame_id === "world");
    assert.ok(body.translation.z > 0.05 && body.translation.z < 2, JSON.stringify(body));
    const joints = (await client.some("/joint_states", 1))[0].joints;
    assert.equal(joints.length, 20);
    assert.ok(joints.every((joint) => Number.isFinite(joint.position)), JSON.stringify(joints));
    client.close();
  });

  test("a monitor shows the joints that a robot on a bus reports", async () => {
    const monitor = new Program(program, ["monitor", "--bus", bus, "--robot", "robots/agilebot.toml", "--foxglove", "0"]);
    try {
      const client = await Client.connect(await monitor.said(/ws:\S+/));
      const states = await client.some("/joint_states", 3);
      assert.equal(states[0].joints.length, 20);
      await client.some("/tf", 3);
      client.close();
    } finally {
      monitor.kill();
    }
  });

  test("clients of the older subprotocol are served, too, and others are refused", async () => {
    const client = await Client.connect(address, "foxglove.websocket.v1");
    await client.some("/tf", 2);
    client.close();
    await assert.rejects(Client.connect(address, "chat"), /400/);
  });

  test("a port that is taken is refused with what to do", async () => {
    const port = address.split(":").at(-1);
    const other = new Program(simulator, ["robots/agilebot.toml", "--bus", `${bus}.other`, "--foxglove", port]);
    try {
      await assert.rejects(other.said(/Ctrl-C/), /cannot serve Foxglove on 127\.0\.0\.1[\s\S]*--foxglove PORT/);
    } finally {
      other.kill();
    }
  });
});
