// What node-mavlink, with the fields of mavlink-mappings, reads in a file of MAVLink 2: a line of JSON a message.
//   node read_mavlink.mjs FILE
import { readFileSync } from "node:fs";
import { PassThrough } from "node:stream";
import { common, createMavLinkStream, minimal } from "node-mavlink";

const registry = { ...minimal.REGISTRY, ...common.REGISTRY };
const input = new PassThrough();
const messages = createMavLinkStream(input, {
  onCrcError: () => {
    throw new Error("a wrong checksum");
  },
});
messages.on("data", (packet) => {
  const { header, payload, protocol } = packet;
  const kind = registry[header.msgid];
  if (kind === undefined) throw new Error(`an unknown message ${header.msgid}`);
  const fields = Object.fromEntries(Object.entries(protocol.data(payload, kind)));
  const text = (key, value) =>
    typeof value === "bigint" ? Number(value) : typeof value === "number" && !Number.isFinite(value) ? String(value) : value;
  console.log(JSON.stringify({ number: header.msgid, system: header.sysid, component: header.compid, fields }, text));
});
input.end(readFileSync(process.argv[2]));
