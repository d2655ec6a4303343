// The functions of the RP2040's boot ROM that the image calls (data sheet, section 2.8.3.1), which rp2040js lacks, and the flash memory
// that they program. Each function is a breakpoint and a return in the emulated ROM; its work is done here.
//
// From flash_exit_xip to the second stage of the boot loader the flash executes commands. As on the board, the program reads wrong
// values from it during this time.

const TABLE = 0x100, FUNCTIONS = 0x200;
const NAMES = ['lookup', 'IF', 'EX', 'FC', 'RE', 'RP', 'UB'];
/// Unique identifier of the flash memory; its value is arbitrary.
export const UNIQUE_ID = [0xe6, 0x60, 0x58, 0x38, 0x83, 0x0a, 0x12, 0x34];
// Bytes of flash that are erased and programmed at once, and the typical times (Winbond W25Q16JV data sheet).
const SECTOR = 4096, PAGE = 256, ERASE_NS = 45e6, PROGRAM_NS = 400e3;
// Registers of the SSI, which drives the flash (data sheet, section 4.10.13).
const SSI = 0x18000, CTRLR0 = 0x00, CTRLR1 = 0x04, SSIENR = 0x08, SR = 0x28, DR0 = 0x60, SPI_CTRLR0 = 0xf4;
const EEPROM_READ = 3 << 8, READ_UNIQUE_ID = 0x4b, READY = 0x6, RECEIVED = 0x8;

export const load = (mcu, passTime, startBootLoader) => {
  const rom = mcu.bootrom;
  const address = (name) => FUNCTIONS + 4 * NAMES.indexOf(name);
  NAMES.forEach((name, number) => (rom[address(name) / 4] = (0x4770_be00 | number) >>> 0)); // BKPT number; BX LR
  rom[0x14 / 4] = TABLE; // 16-bit pointers to the tables of functions and of data
  rom[0x18 / 4] = address('lookup') | 1;

  const commanded = () => {
    if (!hidden) throw new Error('the flash is read, and takes no command');
    return hidden;
  };
  let hidden; // content of the flash while it executes commands
  const registers = mcu.core.registers;
  const functions = {
    lookup() {
      const code = String.fromCharCode(registers[1] & 0xff, registers[1] >> 8);
      if (registers[0] !== TABLE || !NAMES.includes(code)) throw new Error(`no ROM function ${code}`);
      registers[0] = address(code) | 1;
    },
    IF() {},
    EX() {
      hidden = mcu.flash.slice();
      mcu.flash.fill(0xde);
    },
    FC() {},
    RE() {
      const [offset, bytes] = registers;
      if (offset % SECTOR !== 0 || bytes % SECTOR !== 0) throw new Error(`sector at 0x${offset.toString(16)}`);
      commanded().fill(0xff, offset, offset + bytes);
      passTime((bytes / SECTOR) * ERASE_NS);
    },
    RP() {
      const [offset, data, bytes] = registers;
      if (offset % PAGE !== 0 || bytes % PAGE !== 0) throw new Error(`page at 0x${offset.toString(16)}`);
      const flash = commanded();
      for (let at = 0; at < bytes; at++) flash[offset + at] &= mcu.readUint8(data + at);
      passTime((bytes / PAGE) * PROGRAM_NS);
    },
    UB: () => startBootLoader([registers[0], registers[1]]),
  };
  mcu.onBreak = (number) => {
    if (mcu.core.PC > FUNCTIONS + 4 * NAMES.length) throw new Error(`breakpoint at 0x${mcu.core.PC.toString(16)}`);
    functions[NAMES[number]]();
  };

  const ssi = mcu.peripherals[SSI];
  const [readRegister, writeRegister] = [ssi.readUint32.bind(ssi), ssi.writeUint32.bind(ssi)];
  let received = [], configured = false;
  ssi.readUint32 = (offset) => {
    if (hidden && offset === SR) return READY | (received.length > 0 ? RECEIVED : 0);
    if (hidden && offset === DR0) return received.shift() ?? 0;
    return readRegister(offset);
  };
  ssi.writeUint32 = (offset, value) => {
    writeRegister(offset, value);
    if (!hidden) return;
    if (offset === SPI_CTRLR0) configured = true;
    if (offset === SSIENR && value === 1 && configured) {
      // The second stage of the boot loader has set up the flash for reading.
      mcu.flash.set(hidden);
      [hidden, configured] = [undefined, false];
    } else if (offset === DR0 && value === READ_UNIQUE_ID && readRegister(CTRLR0) & EEPROM_READ) {
      received = [0, 0, 0, 0, ...UNIQUE_ID].slice(0, readRegister(CTRLR1) + 1);
    }
  };
};
