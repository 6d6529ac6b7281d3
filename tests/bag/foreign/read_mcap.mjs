// What the format's own library finds in an MCAP file, by its index: a line for each message.
//   node read_mcap.mjs FILE
import { open } from "node:fs/promises";
import { McapIndexedReader } from "@mcap/core";

const file = await open(process.argv[2]);
const readable = {
  size: async () => BigInt((await file.stat()).size),
  read: async (offset, length) => {
    const bytes = new Uint8Array(Number(length));
    await file.read(bytes, 0, Number(length), Number(offset));
    return bytes;
  },
};
const reader = await McapIndexedReader.Initialize({ readable });
for await (const message of reader.readMessages({ validateCrcs: true })) {
  const channel = reader.channelsById.get(message.channelId);
  const schema = reader.schemasById.get(channel.schemaId);
  console.log(`${channel.topic} ${schema.name} ${message.logTime} ${message.data.length}`);
}
console.log(`messages ${reader.statistics.messageCount}`);
await file.close();
