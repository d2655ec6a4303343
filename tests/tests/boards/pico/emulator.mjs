// Runs an RP2040 image in rp2040js. A restart by the watchdog or by the firmware keeps the memory. The parent process simulates the
// sensor: it reads questions from this program's standard output and writes answers to its standard input.
//
// Arguments, in this order:
// - the folder of rp2040js;
// - the image as UF2 and as ELF, which must agree;
// - the time to run, s;
// - `ok` or `dead` for the crystal;
// - a fault and its time in s: `none`, `dma` (an error of the channel that receives a burst), `period` (the programmed sample period
//   becomes 0), `exception`, `lockup`;
// - the time in s from which a USB host reads the serial port, or `none`;
// - a file with the flash memory for the settings, which is written at the end, or `none`;
// - keys as TIME=TEXT for the UART and as usb:TIME=TEXT for the USB port.
//
// A question is one byte and a number (f64, little-endian), which is a time in ns unless another number is stated:
// - `n` advances the sensor to the time. The answer is the number of samples and the time of the next one (two f64).
// - `c` has the frequency of SCK in Hz, before every frame.
// - `s` and `d` are the falling and the rising edge of chip select.
// - `b` and a further byte are a transfer over SPI. The answer is a byte.
// - `u` and a further byte are an output of the UART, `v` and a further byte one of the USB port.
// - `x` and a further byte are a letter of the USB descriptors' text.
// - `o` is the start of the boot loader, which ends the run.
// - `z` and `Z` are the falling and the rising edge of the sensor's RST.
// At the end follow `r` with each register of which the test asserts bits (SSPCR0 of SPI0, PROC0_INTE2 of the pins, CTRL of the watchdog,
// the pads of GP16 and GP20), `l` with the number of changes of the LED, `w` with the longest time in ns for which the watchdog was not
// fed, and `e` with the number of instructions. Only `n` and `b` have an answer.
import fs from 'node:fs';
import path from 'node:path';
import { pathToFileURL } from 'node:url';

const [folder, uf2File, elfFile, seconds, crystal, fault, faultSeconds, usbReads, settingsFile, ...keyArguments] = process.argv.slice(2);
const load = (file) => import(pathToFileURL(path.join(folder, 'node_modules/rp2040js/dist/esm', file)));
const { RP2040, GPIOPinState } = await load('index.js');
const { SimulationClock } = await load('clock/simulation-clock.js');
const bootRom = await import(pathToFileURL(path.join(import.meta.dirname, 'boot-rom.mjs')));
const usbHost = await import(pathToFileURL(path.join(import.meta.dirname, 'usb-host.mjs')));

const PIN_SELECT = 17, PIN_DATA_READY = 20, PIN_RESET = 21, PIN_LED = 25, PULSE_NS = 100_000, STRIDE_NS = 1_000_000;
const PIN_CLOCK = 18, PINS = 0x40014, FUNCTION_SPI = 1; // IO_BANK0 (data sheet, section 2.19.6.1)
const USB_INTERRUPT = 5; // its number in the NVIC (data sheet, section 2.3.2)
const SETTINGS = 0x1f0000; // offset in flash; the settings end at 2 MiB
const FLASH = 0x10000000, WATCHDOG = 0x40058;
const HARD_FAULT = 3; // number of the exception
const keys = keyArguments.map((key) => {
  const isUsb = key.startsWith('usb:');
  return [isUsb, parseFloat(isUsb ? key.slice(4) : key) * 1e9, key.slice(key.indexOf('=') + 1)];
});
let end = seconds * 1e9;

const diagnostics = new Map();
const report = (from, text) => diagnostics.set(`${from}: ${text}`, true);

const uf2 = fs.readFileSync(uf2File);
const elf = fs.readFileSync(elfFile);
// Writes the payload of every block (https://github.com/microsoft/uf2) to its address, as the boot loader does.
const program = (mcu) => {
  for (let block = 0; block < uf2.length; block += 512) {
    const [magic0, magic1, , address, size] = [0, 4, 8, 12, 16].map((field) => uf2.readUInt32LE(block + field));
    if (magic0 !== 0x0a324655 || magic1 !== 0x9e5d5157) throw new Error(`no UF2 block at ${block}`);
    mcu.flash.set(uf2.subarray(block + 32, block + 32 + size), address - FLASH);
  }
  // The loadable segments of the ELF (32 bits, little-endian), which a debug probe would write, must be equal.
  for (let i = 0; i < elf.readUInt16LE(44); i++) {
    const header = elf.readUInt32LE(28) + i * 32;
    const [kind, offset, , address, size] = [0, 4, 8, 12, 16].map((field) => elf.readUInt32LE(header + field));
    if (kind !== 1 || size === 0 || address < FLASH || address >= FLASH + mcu.flash.length) continue;
    const segment = elf.subarray(offset, offset + size);
    if (!segment.equals(mcu.flash.subarray(address - FLASH, address - FLASH + size))) {
      throw new Error(`UF2 and ELF differ in the segment at 0x${address.toString(16)}`);
    }
  }
};

const ask = (kind, value, byte, answerLength) => {
  const question = Buffer.alloc(byte === undefined ? 9 : 10);
  question.write(kind);
  question.writeDoubleLE(value, 1);
  if (byte !== undefined) question[9] = byte;
  for (let done = 0; done < question.length; ) done += fs.writeSync(1, question, done);
  const answer = Buffer.alloc(answerLength);
  for (let done = 0; done < answerLength; ) {
    const count = fs.readSync(0, answer, done, answerLength - done, null);
    if (count === 0) process.exit(1);
    done += count;
  }
  return answer;
};

// These values outlast a restart of the microcontroller: settings, time, samples of the sensor, fault, counts.
let settings = fs.existsSync(settingsFile) ? fs.readFileSync(settingsFile) : undefined;
let startedAt = 0, samples = 0, instructions = 0, ledChanges = 0, longestUnfed = 0;
let faultAt = parseFloat(faultSeconds) * 1e9;

// Runs the microcontroller from its boot to its restart or to the end, and returns it. `retained` is the memory before the boot, which
// a reset by the watchdog does not clear (Pico SDK, `__uninitialized_ram`). `reason` is the watchdog's register with the cause of the
// reset (RP2040 data sheet, section 4.7.6).
const run = (retained, reason) => {
  const clock = new SimulationClock();
  const now = () => startedAt + clock.nanos;
  const mcu = new RP2040(clock);
  mcu.logger = { debug() {}, info() {}, warn: report, error: report };
  program(mcu);
  if (settings) mcu.flash.set(settings, SETTINGS);
  if (retained) mcu.sram.set(retained);
  // The boot ROM copies the second stage to the top of memory and calls it.
  mcu.sram.set(mcu.flash.subarray(0, 252), 0x41f00);
  Object.assign(mcu.core, { SP: 0x20041f00, LR: 0, PC: 0x20041f00 });
  // rp2040js lacks these registers with the cause of the chip's reset, which is power-on.
  mcu.peripherals[0x40064] = {
    readUint32: (offset) => (offset === 8 ? 1 << 8 : 0),
    writeUint32() {},
    writeUint32Atomic() {},
  };
  if (crystal === 'dead') {
    // XOSC STATUS (offset 4) never reports a stable oscillator.
    mcu.peripherals[0x40024] = { readUint32: () => 0, writeUint32() {}, writeUint32Atomic() {} };
  }

  // A pin is pulled down after a reset, so an edge of SCK before chip select is driven would count as an edge within a frame.
  const pins = mcu.peripherals[PINS];
  const writePins = pins.writeUint32.bind(pins);
  pins.writeUint32 = (offset, value) => {
    if (offset === 8 * PIN_CLOCK + 4 && (value & 0x1f) === FUNCTION_SPI && mcu.gpio[PIN_SELECT].value !== GPIOPinState.High) {
      report('SPI', 'SCK is driven before chip select is high');
    }
    writePins(offset, value);
  };

  const watchdog = mcu.peripherals[WATCHDOG];
  watchdog.reason = reason;
  let restarts = false, lockedUp = false;
  watchdog.onWatchdogTrigger = () => {
    watchdog.alarm.enable = false; // an enabled alarm at 0 would fire endlessly at the same time
    restarts = true;
  };
  // A write to LOAD (offset 4) feeds the watchdog.
  let fed = 0;
  const writeWatchdog = watchdog.writeUint32.bind(watchdog);
  watchdog.writeUint32 = (offset, value) => {
    if (offset === 4) {
      longestUnfed = Math.max(longestUnfed, clock.nanos - fed);
      fed = clock.nanos;
    }
    writeWatchdog(offset, value);
  };

  const spi = mcu.spi[0];
  // After an error of the bus the channel halts and raises no interrupt (RP2040 data sheet, section 2.5.7).
  const failReceiving = () => {
    const channel = mcu.dma.channels[0];
    if (fault !== 'dma' || now() < faultAt || !(channel.ctrl & (1 << 24)) || channel.transCount > 13) return;
    faultAt = Infinity;
    channel.ctrl = (channel.ctrl | (1 << 30)) & ~(1 << 24);
    channel.transferAlarm.cancel();
  };
  spi.onTransmit = (value) => {
    const answer = ask('b', now(), value & 0xff, 1)[0];
    failReceiving();
    clock.createAlarm(() => spi.completeTransmit(answer)).schedule((spi.dataBits * 1e9) / spi.clockFrequency);
  };
  mcu.gpio[PIN_SELECT].addListener((state) => {
    if (state === GPIOPinState.Low) {
      ask('c', spi.clockFrequency, undefined, 0);
      ask('s', now(), undefined, 0);
    }
    if (state === GPIOPinState.High) ask('d', now(), undefined, 0);
  });
  const isDriven = (state) => state === GPIOPinState.Low || state === GPIOPinState.High;
  // On boards that connect RST, the part has no supply while RST is low.
  mcu.gpio[PIN_RESET].addListener((state, before) => {
    if (state === GPIOPinState.Low && before === GPIOPinState.High) ask('z', now(), undefined, 0);
    if (state === GPIOPinState.High && before === GPIOPinState.Low) ask('Z', now(), undefined, 0);
  });
  mcu.gpio[PIN_LED].addListener((state, before) => (ledChanges += isDriven(state) && isDriven(before) ? 1 : 0));
  mcu.uart[0].onByte = (byte) => ask('u', now(), byte, 0);

  // Data ready has a pulse at every sample. The time of the next sample is requested at least every STRIDE_NS, since settings may
  // change it.
  const edge = clock.createAlarm(() => {
    const answer = ask('n', now(), undefined, 16);
    const [taken, next] = [answer.readDoubleLE(0), answer.readDoubleLE(8)];
    if (taken > samples) {
      samples = taken;
      mcu.gpio[PIN_DATA_READY].setInputValue(true);
      clock.createAlarm(() => mcu.gpio[PIN_DATA_READY].setInputValue(false)).schedule(PULSE_NS);
    }
    edge.schedule(Math.max(1, Math.min(next - now(), STRIDE_NS)));
  });
  edge.schedule(1);
  // The processor clears a pending interrupt when it enters the handler, and sets it again if the line is still active when the handler
  // returns. rp2040js clears it only with the line, so an interrupt requested by the program, as for the USB port, would never end.
  const { core } = mcu;
  const [enter, leave] = [core.exceptionEntry.bind(core), core.exceptionReturn.bind(core)];
  core.exceptionEntry = (number) => {
    if (number === 16 + USB_INTERRUPT) core.pendingInterrupts &= ~(1 << USB_INTERRUPT);
    enter(number);
  };
  core.exceptionReturn = (...how) => {
    const result = leave(...how);
    if (mcu.usbCtrl.intStatus) mcu.usbCtrl.checkInterrupts();
    return result;
  };
  const sendBytes = (kind, bytes) => bytes.forEach((byte) => ask(kind, now(), byte, 0));
  const typeOverUsb = usbReads === 'none' ? undefined : usbHost.connect(
    mcu, clock, parseFloat(usbReads) * 1e9 - startedAt,
    (text) => sendBytes('x', Buffer.from(text)),
    (packet) => sendBytes('v', packet),
  );
  const typeOverUart = (text) => [...text].forEach((key) => mcu.uart[0].feedByte(key.charCodeAt(0)));
  for (const [isUsb, at, text] of keys) {
    if (at >= now()) clock.createAlarm(() => (isUsb ? typeOverUsb : typeOverUart)(text)).schedule(at - now());
  }
  bootRom.load(mcu, (ns) => clock.tick(ns), (masks) => {
    if (masks.some((mask) => mask !== 0)) throw new Error(`boot loader with ${masks}`);
    ask('o', now(), undefined, 0);
    end = 0;
  });

  // Faults of the processor occur between two instructions.
  const fail = {
    // Every aligned pair of words with the programmed period in 1/256 us becomes 0, so the firmware divides by 0.
    period() {
      const memory = new BigUint64Array(mcu.sram.buffer);
      memory.forEach((value, index) => (memory[index] = value === 1_250_000n ? 0n : value));
    },
    exception: () => mcu.core.exceptionEntry(HARD_FAULT),
    // The core executes no further instruction, as after a fault within the fault handler.
    lockup: () => (lockedUp = true),
  }[fault];
  while (now() < end && !restarts) {
    // A sleeping core executes no instruction that could fail.
    if (fail && now() >= faultAt && !mcu.core.waiting) {
      faultAt = Infinity;
      fail();
    }
    if (mcu.core.waiting || lockedUp) {
      clock.tick(clock.nanosToNextAlarm || STRIDE_NS);
    } else {
      const cycles = mcu.core.executeInstruction();
      instructions++;
      clock.tick((cycles * 1e9) / mcu.clkSys);
    }
  }
  startedAt = now();
  settings = mcu.flash.slice(SETTINGS, 2 << 20);
  return mcu;
};

let mcu = run(undefined, 0);
while (startedAt < end) mcu = run(mcu.sram, mcu.peripherals[WATCHDOG].reason);
if (settingsFile !== 'none') fs.writeFileSync(settingsFile, settings);
for (const diagnostic of diagnostics.keys()) console.error(diagnostic);
for (const address of [0x4003c000, 0x40014108, 0x40058000, 0x4001c044, 0x4001c054]) ask('r', mcu.readUint32(address), undefined, 0);
ask('l', ledChanges, undefined, 0);
ask('w', longestUnfed, undefined, 0);
ask('e', instructions, undefined, 0);
process.exit(0);
