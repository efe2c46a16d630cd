// node read_mcap.js FILE: reads an MCAP file with Foxglove's packages, and prints what is in it as JSON:
// {"messages": {topic: count}, "schemas": {topic: schema}, "first": {topic: message}}
// node read_mcap.js --published: prints the JSON Schemas that Foxglove publishes, {name: schema}.
const { readFileSync } = require("node:fs");

async function read(path) {
  const { McapIndexedReader } = require("@mcap/core");
  const { loadDecompressHandlers } = require("@mcap/support");
  const bytes = readFileSync(path);
  const readable = {
    size: async () => BigInt(bytes.length),
    read: async (offset, length) => new Uint8Array(bytes.subarray(Number(offset), Number(offset + length))),
  };
  const reader = await McapIndexedReader.Initialize({ readable, decompressHandlers: await loadDecompressHandlers() });
  const found = { messages: {}, schemas: {}, first: {} };
  const text = new TextDecoder();
  for (const channel of reader.channelsById.values()) {
    const schema = reader.schemasById.get(channel.schemaId);
    if (channel.messageEncoding !== "json" || schema.encoding !== "jsonschema") throw new Error(`${channel.topic}: not JSON`);
    found.schemas[channel.topic] = JSON.parse(text.decode(schema.data));
    found.messages[channel.topic] = 0;
  }
  for await (const message of reader.readMessages()) {
    const { topic } = reader.channelsById.get(message.channelId);
    found.messages[topic]++;
    found.first[topic] ??= JSON.parse(text.decode(message.data));
  }
  return found;
}

const argument = process.argv[2];
Promise.resolve(argument === "--published" ? require("@foxglove/schemas/jsonschema") : read(argument))
  .then((found) => process.stdout.write(JSON.stringify(found)))
  .catch((error) => {
    console.error(error);
    process.exit(1);
  });
