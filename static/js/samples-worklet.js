// Passes the microphone's samples on in blocks of 1/8 s.
const BLOCK = 2000;

class Samples extends AudioWorkletProcessor {
  block = new Float32Array(BLOCK);
  filled = 0;

  process([[channel]]) {
    for (const one of channel ?? []) {
      this.block[this.filled++] = one;
      if (this.filled === BLOCK) {
        this.port.postMessage(this.block.slice());
        this.filled = 0;
      }
    }
    return true;
  }
}

registerProcessor("samples", Samples);
