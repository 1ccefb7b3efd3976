// Runs the detector's network: pictures on standard input, raw scores and boxes on standard output, until input ends.
//
// Argument: the folder that `regen vision install` filled. Request: 416 x 416 pixels, blue, green and red, one byte
// each. Answer: the network's six outputs as 32-bit numbers, finest stride first, scores before boxes.
import { readFileSync, readSync, writeSync } from "node:fs";
import { createRequire } from "node:module";
import { join } from "node:path";

const SIDE = 416;
const MEAN = [103.53, 116.28, 123.675];
const DEVIATION = [57.375, 57.12, 58.395];
const CELLS = [2704, 676, 169];
const WIDTHS = [80, 44];
const PIXELS = SIDE * SIDE;

const folder = process.argv[2];
const require = createRequire(join(folder, "package.json"));
console.log = console.info = console.warn = () => {};
const tf = require("@tensorflow/tfjs-core");
const { loadGraphModel } = require("@tensorflow/tfjs-converter");
const wasm = require("@tensorflow/tfjs-backend-wasm");

async function network() {
  wasm.setWasmPaths(join(folder, "node_modules/@tensorflow/tfjs-backend-wasm/dist/"));
  wasm.setThreadsCount(1);
  await tf.setBackend("wasm");
  const graph = JSON.parse(readFileSync(join(folder, "models", "nanodet.json")));
  const weights = readFileSync(join(folder, "models", "nanodet.bin"));
  return loadGraphModel(
    tf.io.fromMemory({
      modelTopology: graph.modelTopology,
      signature: graph.signature,
      weightSpecs: graph.weightsManifest[0].weights,
      weightData: weights.buffer.slice(weights.byteOffset, weights.byteOffset + weights.byteLength),
    }),
  );
}

// One whole request, or null at the end of the input.
function received(length) {
  const request = Buffer.alloc(length);
  for (let at = 0; at < length; ) {
    const count = readSync(0, request, at, length - at, null);
    if (count === 0) return null;
    at += count;
  }
  return request;
}

function sent(body) {
  for (let at = 0; at < body.length; ) at += writeSync(1, body, at, body.length - at);
}

function normalised(pixels) {
  const planes = new Float32Array(3 * PIXELS);
  for (let index = 0; index < PIXELS; index++)
    for (let plane = 0; plane < 3; plane++)
      planes[plane * PIXELS + index] = (pixels[3 * index + plane] - MEAN[plane]) / DEVIATION[plane];
  return planes;
}

async function answered(model, pixels) {
  const input = tf.tensor4d(normalised(pixels), [1, 3, SIDE, SIDE]);
  const outputs = await model.executeAsync(input);
  for (const cells of CELLS)
    for (const width of WIDTHS) {
      const output = outputs.find((one) => one.shape[1] === cells && one.shape[2] === width);
      const values = await output.data();
      sent(Buffer.from(values.buffer, values.byteOffset, values.byteLength));
    }
  tf.dispose([input, ...outputs]);
}

const model = await network();
sent(Buffer.from("R"));
for (let request = received(3 * PIXELS); request !== null; request = received(3 * PIXELS)) await answered(model, request);
