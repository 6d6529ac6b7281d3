// An MCAP file by the format's own library from a dump of make_bag.py.
//   node write_mcap.mjs DUMP OUT none|lz4|zstd PYTHON
import { spawnSync } from "node:child_process";
import { readFileSync, writeFileSync } from "node:fs";
import { McapWriter } from "@mcap/core";

const [dump, out, packing, python] = process.argv.slice(2);
const packers = {
  lz4: "lz4.frame.compress(data)",
  zstd: "zstandard.ZstdCompressor().compress(data)",
};

function compressChunk(chunk) {
  const module = packing === "lz4" ? "lz4.frame" : "zstandard";
  const program = `import sys, ${module}; data = sys.stdin.buffer.read(); sys.stdout.buffer.write(${packers[packing]})`;
  const done = spawnSync(python, ["-c", program], { input: chunk, maxBuffer: 1 << 28 });
  if (done.status !== 0) throw new Error(String(done.stderr));
  return { compression: packing, compressedData: new Uint8Array(done.stdout) };
}

const pieces = [];
let size = 0n;
const writable = {
  async write(bytes) {
    pieces.push(Buffer.from(bytes));
    size += BigInt(bytes.length);
  },
  position: () => size,
};
const writer = new McapWriter({ writable, chunkSize: 500_000, ...(packing === "none" ? {} : { compressChunk }) });
await writer.start({ profile: "ros2", library: "tests" });
const schemas = new Map();
const channels = new Map();
const bytes = readFileSync(dump);
for (let at = 0, sequence = 0; at < bytes.length; ++sequence) {
  const line = bytes.readUInt32LE(at);
  const length = bytes.readUInt32LE(at + 4);
  const { topic, kind, time_ns } = JSON.parse(bytes.subarray(at + 8, at + 8 + line).toString());
  const data = bytes.subarray(at + 8 + line, at + 8 + line + length);
  at += 8 + line + length;
  if (!schemas.has(kind)) {
    const schema = { name: kind, encoding: "ros2msg", data: Buffer.from("not needed") };
    schemas.set(kind, await writer.registerSchema(schema));
  }
  if (!channels.has(topic)) {
    const channel = { topic, schemaId: schemas.get(kind), messageEncoding: "cdr", metadata: new Map() };
    channels.set(topic, await writer.registerChannel(channel));
  }
  const time = BigInt(time_ns);
  await writer.addMessage({ channelId: channels.get(topic), sequence, logTime: time, publishTime: time, data });
}
await writer.end();
writeFileSync(out, Buffer.concat(pieces));
